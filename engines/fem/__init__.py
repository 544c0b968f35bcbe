"""Soft tissue of our own: finite elements in explicit dynamics."""
