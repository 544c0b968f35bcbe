"""A stylus for people who have none: moved by keys or a gamepad."""
