"""Organs: shapes, materials, anchors."""
