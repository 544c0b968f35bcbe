"""Tetrahedral meshes: made, read, checked, measured."""
