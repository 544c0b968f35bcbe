"""The part of cyclonedds that is used here: its own annotations leave policies, samples and all calls into its library unknown."""
