"""The probes pressing on and grasping tissue."""
