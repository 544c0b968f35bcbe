"""Needle tracking: where the needle is in the gripper, from both eyes' pictures and the arms' kinematics."""
