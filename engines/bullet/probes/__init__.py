"""The probes that press on tissue and grasp it."""
