"""The robot as an FMU for other programs: model and servos compiled into a library, with MuJoCo beside it."""

from engines.mujoco.export.fmu.archive import FmiVersion, write_fmu

__all__ = ["FmiVersion", "write_fmu"]
