"""Textures from noise: colour, bumps and roughness of tissue, metal and cloth, the same for the same seed."""
