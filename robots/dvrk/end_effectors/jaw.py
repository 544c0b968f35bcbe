"""A jaw: two fingers about the wrist yaw axis, each turned by half the jaw's angle, either way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import radians
from typing import ClassVar

import numpy as np

from robots.dvrk.drive import Disc, Drive
from robots.dvrk.end_effectors.contact_sphere import FINGER_HALF_WIDTH, ContactSphere, on_jaw
from robots.dvrk.end_effectors.end_effector import EndEffector, Motor, Mount
from robots.dvrk.inertia import Inertia
from robots.dvrk.link import Link
from robots.serial_chain import Joint, jerk_limit
from schemas.vectors import Vector

__all__ = ["FINGERS", "FINGER_PAIRS", "WRIST_ACCELERATION", "WRIST_VELOCITY", "Jaw"]

FINGERS = ("jaw_left", "jaw_right")
"""Links: the left one turns towards the tip's +y, the right one towards -y."""
FINGER_PAIRS = (
    Disc({"wrist_yaw": 1.0, FINGERS[0]: 1.0}, 0.0, 0.0),
    Disc({"wrist_yaw": 1.0, FINGERS[1]: -1.0}, 0.0, 0.0),
    Disc({FINGERS[0]: 1.0, FINGERS[1]: 1.0}, 0.0, 0.0),
)
"""Rubbing pairs beside the discs: left finger and right finger on the pin, and both on each other.

No friction is published; identification finds it (WPI-AIM/dvrk_dynamics_identification has these pairs).
"""

WRIST_VELOCITY, WRIST_ACCELERATION = radians(1080.0), radians(720.0)
"""rad/s and rad/s^2, of roll, wrist and jaw (jhu-dvrk/sawIntuitiveResearchKit,
core/components/code/mtsIntuitiveResearchKitPSM.cpp).
"""

_FINGER_MASS = 3.90696e-5
"""kg of one finger (WPI-AIM/dvrk_env, tool_lnd.urdf.xacro: CAD of the large needle driver, for all)."""
_HALF_TURN = np.diag([1.0, -1.0, -1.0, 1.0])
"""About x: the right finger opens the other way."""


@dataclass(frozen=True)
class Jaw(EndEffector):
    """Two fingers that one motor opens and closes."""

    lower: float
    """Smallest angle, rad; below 0 the fingers press on each other."""
    upper: float
    effort: float
    """Largest torque, N m."""
    length: float
    """Distance of the end of the fingers from the wrist yaw axis, m."""
    disc_share: float
    """Sum over the instrument's discs of the square of their turn (rad) for a radian of the jaw."""
    velocity: float = WRIST_VELOCITY
    acceleration: float = WRIST_ACCELERATION
    jerk: float = jerk_limit(WRIST_ACCELERATION)

    name: ClassVar[str] = "jaw"
    goal: ClassVar[str] = "goal of the jaw's servo"

    @property
    def joint(self) -> Joint:
        """The angle as a joint."""
        limits = (self.velocity, self.effort, self.acceleration, self.jerk)
        return Joint("jaw", "revolute", 0.0, 0.0, 0.0, 0.0, self.lower, self.upper, *limits)

    @property
    def joints(self) -> tuple[Joint, ...]:
        """The angle."""
        return (self.joint,)

    @property
    def motors(self) -> tuple[Motor, ...]:
        """A servo for each finger.

        Both fingers turn by half the jaw's angle and share its inertia and stiffness; the torque of each
        works along the whole of the angle.
        """
        drive = Drive.of_disc(2.0 * self.disc_share, self.effort, self.velocity / 2.0)
        return tuple(Motor(finger, "jaw", "disc", drive, {finger: 1.0}, share=0.5) for finger in FINGERS)

    def links(self, mount: Mount, /) -> tuple[Link, ...]:
        """Return the fingers."""
        ends = self.lower / 2, self.upper / 2
        return tuple(
            Link(finger, mount.link, "revolute", mount.pose @ turn, *ends)
            for finger, turn in zip(FINGERS, (np.eye(4), _HALF_TURN), strict=True)
        )

    def bodies(self, mount: Mount, /) -> Mapping[str, Inertia]:
        """Return the fingers, closed."""
        end = mount.pose[:3, 3]
        finger = Inertia.of_rod(_FINGER_MASS, end, end + self.length * mount.ahead, FINGER_HALF_WIDTH)
        return dict.fromkeys(FINGERS, finger)

    def spheres(self, tip: Vector, /) -> tuple[ContactSphere, ...]:
        """Return the spheres along both fingers."""
        return on_jaw(self.length, tip[:3, 2])
