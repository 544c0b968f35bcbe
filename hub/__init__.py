"""The hub: session, clock, hosts, coupling, recording, control and command line; and the participant side
that others build on.
"""
