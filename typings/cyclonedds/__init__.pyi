"""The part of cyclonedds that is used here.

Its own annotations leave policies, samples and all calls into its library unknown.
"""
