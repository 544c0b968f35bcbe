"""Haptic styluses behind HDAPI, the C interface of OpenHaptics: a process that holds the SDK and the servo
callback, and the device that watches it.
"""
