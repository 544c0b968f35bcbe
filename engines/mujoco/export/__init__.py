"""The model as files for other programs: MJCF or URDF, with the meshes beside it."""

from engines.mujoco.export.files import FORMATS, Format, write
from engines.mujoco.export.keyframe import START

__all__ = ["FORMATS", "START", "Format", "write"]
