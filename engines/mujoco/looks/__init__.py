"""How the robot looks and what of it collides: meshes generated from published dimensions.

Needs manifold3d, as the extra `mujoco` brings it.
"""

from engines.mujoco.looks.catalogue import collision, parts
from engines.mujoco.looks.part import Material, Part, Primitive

__all__ = ["Material", "Part", "Primitive", "collision", "parts"]
