"""Force on a person's hand: contact rendered at the rate of the device, and the chain of limits that every
force passes.
"""
