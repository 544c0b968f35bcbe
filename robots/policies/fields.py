"""Numbers of a policy's state or action, by name, unit and frame."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from robots.serial_chain import Joint

__all__ = ["Field", "Group", "jaw_field", "joint_fields", "pose_fields"]


@dataclass(frozen=True, slots=True)
class Field:
    """One number of a row."""

    name: str
    unit: str
    """SI unit; empty: a pure number."""
    frame: str = ""
    """Reference frame; empty: none."""

    def __str__(self) -> str:
        unit = f" [{self.unit}]" if self.unit else ""
        return f"{self.name}{unit}" + (f" in {self.frame}" if self.frame else "")


@dataclass(frozen=True, slots=True)
class Group:
    """Neighbouring numbers with one name, such as `psm1_pose`: GR00T sends each group as an array."""

    name: str
    fields: tuple[Field, ...]


def pose_fields(prefix: str, frame: str) -> tuple[Field, ...]:
    """Return position and quaternion (x, y, z, w), named as in Open-H."""
    position = (Field(f"{prefix}.position.{axis}", "m", frame) for axis in "xyz")
    orientation = (Field(f"{prefix}.orientation.{axis}", "", frame) for axis in "xyzw")
    return (*position, *orientation)


def joint_fields(prefix: str, joints: Iterable[Joint]) -> Iterator[Field]:
    """Yield the positions of joints."""
    return (Field(f"{prefix}_{joint.name}", joint.unit) for joint in joints)


def jaw_field(name: str) -> tuple[Field, ...]:
    """Return the opening of a jaw."""
    return (Field(name, "rad"),)
