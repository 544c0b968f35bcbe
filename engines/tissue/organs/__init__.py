"""Organs: shapes, materials, anchors, and bodies in Bullet."""
