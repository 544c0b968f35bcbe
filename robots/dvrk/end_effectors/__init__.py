"""End effectors of instruments: jaws, hands and rigid tips, each in a file, behind one protocol.

The protocol is `end_effector.EndEffector`; docs/decisions/0105 has the reasons.
"""
