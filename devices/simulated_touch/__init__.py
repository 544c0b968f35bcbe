"""A simulated haptic device and hand: for machines without a stylus, and for reproducible studies."""
