"""The gripper of a master: two handles that the fingers of a hand open and close; no motor moves them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import radians
from typing import ClassVar

import numpy as np

from robots.dvrk.drive import Drive
from robots.dvrk.end_effectors.end_effector import EndEffector, Motor, Mount
from robots.dvrk.inertia import Inertia
from robots.dvrk.link import Link
from robots.dvrk.mtm import GRIPPER_OPEN
from robots.serial_chain import Joint, jerk_limit
from schemas.vectors import Vector

__all__ = ["HANDLES", "MasterGripper"]

HANDLES = ("gripper_left", "gripper_right")
"""Links: the left one turns towards the gripper's +y, the right one towards -y."""
_VELOCITY, _ACCELERATION = radians(720.0), radians(7200.0)
"""rad/s and rad/s^2 of a person's fingers; assumed."""
_FINGERS = Drive(0.5, 0.01, 0.0, 0.0, 0.0, 0.0, 5e-5, 0.2, _VELOCITY / 2.0)
"""Fingers on a handle: spring, damper, largest torque and inertia; assumed."""
_MASS, _LENGTH, _RADIUS = 0.002, 0.03, 0.004
"""kg, m and m of a handle; assumed."""


def _hinges() -> tuple[Vector, Vector]:
    """Return the poses of the handles' hinges in the wrist roll's frame, shape (4, 4): z along +x, -x."""
    left = np.array([[0.0, 0.0, 1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    return left, np.diag([-1.0, 1.0, -1.0, 1.0]) @ left


@dataclass(frozen=True)
class MasterGripper(EndEffector):
    """Two handles, each turned by half the gripper's angle, either way."""

    name: ClassVar[str] = "gripper"
    goal: ClassVar[str] = "opening at which the fingers of the hand hold the gripper"

    @property
    def joints(self) -> tuple[Joint, ...]:
        """The angle between the handles."""
        limits = (_VELOCITY, 2.0 * _FINGERS.effort, _ACCELERATION, jerk_limit(_ACCELERATION))
        return (Joint("gripper", "revolute", 0.0, 0.0, 0.0, 0.0, 0.0, GRIPPER_OPEN, *limits),)

    @property
    def motors(self) -> tuple[Motor, ...]:
        """Fingers on each handle."""
        return tuple(
            Motor(handle, "gripper", "disc", _FINGERS, {handle: 1.0}, share=0.5) for handle in HANDLES
        )

    def links(self, mount: Mount, /) -> tuple[Link, ...]:
        """Return the handles."""
        return tuple(
            Link(handle, mount.link, "revolute", mount.pose @ hinge, 0.0, GRIPPER_OPEN / 2.0)
            for handle, hinge in zip(HANDLES, _hinges(), strict=True)
        )

    def bodies(self, mount: Mount, /) -> Mapping[str, Inertia]:
        """Return the handles, closed."""
        end = mount.pose[:3, 3]
        return dict.fromkeys(HANDLES, Inertia.of_rod(_MASS, end, end - _LENGTH * mount.ahead, _RADIUS))
