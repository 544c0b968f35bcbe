"""A haptic device with a hand behind it, both simulated: where no stylus stands, and for studies that are to
give the same bits again.
"""
