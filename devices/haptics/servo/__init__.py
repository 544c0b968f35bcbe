"""Haptic styluses at 1 kHz, in a process of their own, behind a driver for each vendor's library."""
