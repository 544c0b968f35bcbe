"""Looks and collision shapes of the robot: meshes generated from published dimensions.

Needs manifold3d, from the extra `mujoco`.
"""

from engines.mujoco.looks.catalogue import collision, parts
from engines.mujoco.looks.part import Material, Part, Primitive

__all__ = ["Material", "Part", "Primitive", "collision", "parts"]
