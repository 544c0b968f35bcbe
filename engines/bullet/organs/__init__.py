"""Organs: their shapes, their materials, what holds them, and their bodies in Bullet."""
