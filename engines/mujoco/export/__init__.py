"""The model as files for other programs: MJCF or URDF, with the meshes beside it."""

from engines.mujoco.export.files import FORMATS, START, Format, write

__all__ = ["FORMATS", "START", "Format", "write"]
