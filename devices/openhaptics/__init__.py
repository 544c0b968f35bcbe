"""Haptic styluses on OpenHaptics: HDAPI, the driver in the servo process, and the device."""
