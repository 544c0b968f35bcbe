"""Stepped participants without physics."""
