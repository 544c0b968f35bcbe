"""Teleoperation: a hand leads an instrument on a patient-side manipulator, and feels through a contact model what it touches."""
