"""Yield of the surface of tissue under a sphere or a patch: of a half-space, of a body, of its mesh."""
