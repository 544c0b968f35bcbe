"""Haptic styluses on OpenHaptics: a servo process that holds HDAPI, and the device that supervises it."""
