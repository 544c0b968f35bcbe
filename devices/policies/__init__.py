"""Policies that lead arms: the device that asks them, and the protocols in which they are asked."""
