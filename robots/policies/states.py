"""Layouts of states: the readings of an arm as the numbers that a policy sees.

| layout | numbers an arm | meaning |
|---|---|---|
| `open-h-dvrk` | 8 | measured pose of the tip (m, quaternion x, y, z, w), jaw (rad) (Open-H-Embodiment) |
| `joint` | 7 | measured joints (rad or m) and jaw |
| `none` | 0 | pictures alone, as GR00T-H |
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from robots.policies.fields import Group, jaw_field, joint_fields, pose_fields
from robots.serial_chain import Joint
from schemas.vectors import Vector

__all__ = ["ArmReading", "StateName", "encode_state", "state_groups"]

StateName = Literal["open-h-dvrk", "joint", "none"]


@dataclass(slots=True)
class ArmReading:
    """Measured values of an arm."""

    joints: Vector
    """Joint positions, shape (n,), rad or m."""
    jaw: float
    """Jaw opening, rad."""
    tip: Vector
    """Pose of the tip, shape (7,), m and quaternion (x, y, z, w)."""


def state_groups(layout: StateName, arm: str, frame: str, joints: Sequence[Joint]) -> tuple[Group, ...]:
    """Return the numbers of one arm, by group; `frame` is the reference frame of the arm's poses."""
    name = arm.lower()
    if layout == "none":
        return ()
    pose = Group(f"{name}_pose", pose_fields(f"{name}_pose", frame))
    positions = Group(f"{name}_joints", tuple(joint_fields(name, joints)))
    return (
        pose if layout == "open-h-dvrk" else positions,
        Group(f"{name}_gripper", jaw_field(f"{name}_jaw")),
    )


def encode_state(layout: StateName, readings: Sequence[ArmReading]) -> Vector:
    """Return the numbers of all arms, shape (size,)."""
    if layout == "none":
        return np.zeros(0)
    return np.concatenate(
        [
            part
            for reading in readings
            for part in (reading.tip if layout == "open-h-dvrk" else reading.joints, (reading.jaw,))
        ]
    )
