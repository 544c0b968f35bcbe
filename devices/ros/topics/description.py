"""The robot's description as ROS programs get it: a URDF whose meshes can be found."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from schemas.errors import DeviceError

__all__ = ["description"]


def description(file: Path) -> str:
    """Return the URDF in `file`, with the names of its meshes as addresses: a program does not know where the
    file was.

    Raises DeviceError if it is none.
    """
    try:
        robot = ElementTree.fromstring(file.read_text("utf-8"))
    except (OSError, ElementTree.ParseError) as error:
        raise DeviceError(
            f"robot_description '{file}' is no URDF: {error}; `trocar model export` writes one"
        ) from error
    for mesh in robot.iter("mesh"):
        name = mesh.get("filename", "")
        if "://" not in name:
            mesh.set("filename", (file.parent / name).as_uri())
    return ElementTree.tostring(robot, encoding="unicode")
