"""A virtual stylus or head, moved by keys or a gamepad."""
