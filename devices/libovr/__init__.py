"""Headsets of Oculus through LibOVR."""
