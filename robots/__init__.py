"""The robots: numbers, kinematics and instruments, without an engine."""
