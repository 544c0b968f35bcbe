"""The governor between a policy and an arm."""
