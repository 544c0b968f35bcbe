"""The jaw of the rolling needle driver: sliding pads roll the needle.

Published is a needle driver with one degree of freedom more, which turns the needle between its jaws
(Fontanelli et al., "A New Laparoscopic Tool With In-Hand Rolling Capabilities for Needle Reorientation", IEEE
Robotics and Automation Letters, 2018). Its measures we could not read: those here are ours, see
docs/decisions/0019. SI units, radians.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import radians
from typing import ClassVar

import numpy as np

from robots.dvrk.drive import Drive
from robots.dvrk.end_effectors.end_effector import Motor, Mount
from robots.dvrk.end_effectors.jaw import FINGERS, Jaw
from robots.dvrk.inertia import STEEL_DENSITY, Inertia
from robots.dvrk.link import Link
from robots.serial_chain import Joint, jerk_limit

__all__ = ["PADS", "ROLLER", "RollingJaw"]

PADS = ("pad_left", "pad_right")
"""Links: each pad slides along a finger, the left pad forwards while the right pad goes back."""

ROLLER = "roller"
"""Joint: roll of a wire of `RollingJaw.wire_radius` about the wire's tangent, from the middle position of the
pads.
"""

_RANGE = radians(90.0)
"""Either way from a needle with the arc ahead of the jaw to a needle across the jaw, forehand or backhand."""
_VELOCITY, _ACCELERATION = radians(180.0), radians(720.0)
"""The range in a second; acceleration of wrist and jaw (`robots.dvrk.end_effectors.jaw`)."""


@dataclass(frozen=True)
class RollingJaw(Jaw):
    """A jaw with two pads to roll a round wire in place: each pad moves by `wire_radius` times the angle."""

    wire_radius: float = 0.4e-3
    """m, of the needle in unina-icaros/dvrk-vrep (dVRK-suturing.ttt); a thinner wire turns by more."""
    distance: float = 0.0077
    """Distance of the middle of the pads from the wrist yaw axis, m: as far out as pads of this length and
    way have room on a jaw of 10.2 mm.
    """
    size: tuple[float, float, float] = (0.0036, 0.0006, 0.0003)
    """Size of a pad, m: along the finger, along the wire, thickness.

    Narrow as a rail, since a curved wire rolled out of the plane of wide pads wedges the pads apart, by the
    height of the arc over the width of the pads, and slips. Thinner than the wire's radius, so that the
    fingers behind hold a wire ahead of the pads.
    """
    pulley: float = 0.001
    """Way of the pads per radian of the motor, m: a disc more than a PSM turns."""

    goal: ClassVar[str] = (
        "goal of the jaw's servo, and by how much the pads are to roll a needle of 0.8 mm between them"
    )

    @property
    def roller(self) -> Joint:
        """The roll as a joint.

        The largest effort makes the pads slip, at a friction coefficient of 1, on a needle gripped with the
        jaw's full torque.
        """
        effort = 2.0 * self.wire_radius * self.effort / self.distance
        limits = (_VELOCITY, effort, _ACCELERATION, jerk_limit(_ACCELERATION))
        return Joint(ROLLER, "revolute", 0.0, 0.0, 0.0, 0.0, -_RANGE, _RANGE, *limits)

    @property
    def joints(self) -> tuple[Joint, ...]:
        """The jaw's angle, and the roll."""
        return self.joint, self.roller

    @property
    def motors(self) -> tuple[Motor, ...]:
        """The servos of the fingers, and of the pads: in rad of the wire, so the force is a torque on it."""
        drive = Drive.of_disc((self.wire_radius / self.pulley) ** 2, self.roller.effort, self.roller.velocity)
        moves: dict[str, float] = dict.fromkeys(PADS, 0.5 / self.wire_radius)
        return *super().motors, Motor(ROLLER, ROLLER, "gear", drive, moves, tie="pads")

    def links(self, mount: Mount, /) -> tuple[Link, ...]:
        """Return the fingers, then the pads in the fingers."""
        pads: list[Link] = []
        for pad, finger, way in zip(PADS, FINGERS, (mount.ahead, -mount.ahead), strict=True):
            pose = mount.pose.copy()
            pose[:3, :3] = np.column_stack([mount.axis, np.cross(way, mount.axis), way])
            reach = self.wire_radius * self.roller.upper
            pads.append(Link(pad, finger, "prismatic", pose, -reach, reach))
        return *super().links(mount), *pads

    def bodies(self, mount: Mount, /) -> Mapping[str, Inertia]:
        """Return the fingers, and the pads, of steel."""
        along, across, thickness = self.size
        side = np.cross(mount.axis, mount.ahead)  # of the left finger
        size = np.abs(along * mount.ahead + across * mount.axis + thickness * side)
        middle = mount.pose[:3, 3] + self.distance * mount.ahead
        pads = {
            pad: Inertia.of_box(
                STEEL_DENSITY * along * across * thickness, middle + way * thickness / 2.0 * side, size
            )
            for pad, way in zip(PADS, (1.0, -1.0), strict=True)
        }
        return {**super().bodies(mount), **pads}
