"""Headsets of any maker through OpenXR."""
