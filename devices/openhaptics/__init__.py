"""Haptic styluses on OpenHaptics: HDAPI, its driver in the servo process, and the device."""
