"""Plays a recording as a device."""
