"""The jaw of the rolling needle driver: its pads slide to roll the needle between them.

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
"""The links: each slides along its finger, the left one forwards while the right one goes back."""

ROLLER = "roller"
"""The joint: the angle by which a wire of `RollingJaw.wire_radius` rolls about its own tangent, from the
middle position of the pads on.
"""

_RANGE = radians(90.0)
"""Either way from a needle whose arc goes out ahead of the jaw: to one across it, forehand or backhand."""
_VELOCITY, _ACCELERATION = radians(180.0), radians(720.0)
"""The range in a second; the acceleration is that of wrist and jaw (`robots.dvrk.end_effectors.jaw`)."""


@dataclass(frozen=True)
class RollingJaw(Jaw):
    """A jaw with two pads that roll a round wire in place: each moves by `wire_radius` times the angle."""

    wire_radius: float = 0.4e-3
    """m, of the needle in unina-icaros/dvrk-vrep (dVRK-suturing.ttt); a thinner wire turns by more."""
    distance: float = 0.0077
    """From the wrist yaw axis to the middle of the pads, m: as far out as pads of this length and their way
    leave room for on a jaw of 10.2 mm.
    """
    size: tuple[float, float, float] = (0.0036, 0.0006, 0.0003)
    """Size of a pad, m: along the finger, along the wire, and its thickness.

    Narrow as a rail, since a curved wire that is rolled out of the plane of wide pads wedges them apart, by
    the height of its arc over their width, and slips. Thinner than the wire's radius, so that the fingers
    behind hold a wire ahead of the pads.
    """
    pulley: float = 0.001
    """Way of the pads per radian of the motor, m: one disc more than a PSM turns."""

    goal: ClassVar[str] = (
        "goal of the jaw's servo, and by how much the pads are to roll a needle of 0.8 mm between them"
    )

    @property
    def roller(self) -> Joint:
        """The roll as a joint.

        Its effort is what makes the pads slip, at a friction coefficient of 1, on a needle that the jaw grips
        with all its torque.
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
        """The servos of the fingers, and that of both pads.

        Its position is the angle by which the wire rolls, so its force is a torque on the wire.
        """
        drive = Drive.of_disc((self.wire_radius / self.pulley) ** 2, self.roller.effort, self.roller.velocity)
        moves: dict[str, float] = dict.fromkeys(PADS, 0.5 / self.wire_radius)
        return *super().motors, Motor(ROLLER, ROLLER, "gear", drive, moves, tie="pads")

    def links(self, mount: Mount, /) -> tuple[Link, ...]:
        """Return the fingers, then the pads, each in its finger."""
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
