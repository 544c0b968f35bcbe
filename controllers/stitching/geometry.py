"""The way of a curved needle through two holes, and the hold of a jaw. Metres, radians.

The needle turns about the middle of a circle through both holes, in the plane of the holes and the normal
of the skin: guidelines ask for constant curvature, since the needle then follows itself. The needle's angle
is that of the tip: 0 towards the side of approach, a quarter of a turn where the tip points straight down.

A jaw holds the wire across: the fingers point along the needle's axis z, or against it, so that a turn of
the jaw about its own axis drives the needle on, and close along the radius.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import asin, cos, hypot, pi, sin, sqrt

import numpy as np

from robots.training.needles import NeedleShape
from robots.transform import matrix_to_pose
from schemas.errors import MotionError
from schemas.vectors import Vector

__all__ = ["Grip", "Stitch", "approach_pose", "grip_pose", "stitch_between"]


@dataclass(frozen=True)
class Stitch:
    """A way through the tissue, in the frame of the holes."""

    centre: Vector
    """Centre of the circle, shape (3,), m."""
    axes: Vector
    """Columns: against the way on the skin, down into the tissue, the needle's axis of rotation; (3, 3)."""
    entry: float
    """Angle of the tip at the entry, rad."""
    exit: float
    """Angle of the tip at the exit, rad."""
    needle: NeedleShape

    def pose(self, tip: float, lift: float = 0.0) -> Vector:
        """Return the needle's pose, shape (4, 4), for a tip at an angle (rad), raised by `lift` (m)."""
        turn = tip - self.needle.arc / 2.0
        pose = np.eye(4)
        pose[:3, 0] = self.axes[:, :2] @ [cos(turn), sin(turn)]
        pose[:3, 1] = self.axes[:, :2] @ [-sin(turn), cos(turn)]
        pose[:3, 2] = self.axes[:, 2]
        pose[:3, 3] = self.centre - lift * self.axes[:, 1]
        return pose

    def angle(self, pose: Vector) -> float:
        """Return the tip's angle (rad), from 0 to a whole turn, of a needle with a pose on this way."""
        x = self.axes.T @ pose[:3, 0]
        return float(np.mod(np.arctan2(x[1], x[0]) + self.needle.arc / 2.0, 2.0 * pi))

    @property
    def base_out_angle(self) -> float:
        """Angle of the tip when the base has left the tissue, rad."""
        return self.exit + self.needle.arc

    @property
    def depth(self) -> float:
        """Of the deepest point under the line between the holes, m."""
        return self.needle.radius * (1.0 - sin(self.entry))


def stitch_between(entry: Vector, leave: Vector, up: Vector, needle: NeedleShape) -> Stitch:
    """Return the way between two holes, both shape (3,), m; `up`: out of the tissue, shape (3,).

    Raises MotionError if the needle is too small.
    """
    chord = leave - entry
    bite = float(np.sqrt(chord @ chord))
    if bite >= 2.0 * needle.radius:
        raise MotionError(
            f"the holes are {bite * 1e3:.1f} mm apart, and the needle is {2e3 * needle.radius:.1f} mm across"
        )
    along = chord / bite
    axis = np.cross(along, up)
    axis /= hypot(*axis.tolist())
    height = sqrt(needle.radius**2 - bite**2 / 4.0)
    down = np.cross(along, axis)
    angle = asin(height / needle.radius)
    return Stitch(
        centre=(entry + leave) / 2.0 - height * down,
        axes=np.stack([-along, down, axis], axis=1),
        entry=angle,
        exit=pi - angle,
        needle=needle,
    )


@dataclass(frozen=True)
class Grip:
    """How a jaw holds the wire."""

    behind: float
    """How far behind the tip, rad of the arc."""
    left_outside: bool
    """Whether the left finger is on the outer side of the arc."""
    backwards: bool = False
    """Whether the fingers point against the needle's axis."""


def grip_pose(grip: Grip, needle: NeedleShape, reach: float) -> Vector:
    """Return the pose of the tip frame in the needle's frame, shape (4, 4).

    `reach`: from the wrist yaw axis, where the tip frame is, to the wire along the fingers, m.
    """
    angle = needle.arc / 2.0 - grip.behind
    outwards = np.array([cos(angle), sin(angle), 0.0])
    pose = np.eye(4)
    pose[2, 2] = -1.0 if grip.backwards else 1.0
    pose[:3, 1] = outwards if grip.left_outside else -outwards
    pose[:3, 0] = np.cross(pose[:3, 1], pose[:3, 2])
    pose[:3, 3] = needle.radius * outwards - reach * pose[:3, 2]
    return pose


def approach_pose(tip: Vector, away: float) -> Vector:
    """Return a pose of the tip, shape (7,), `away` metres against the fingers from `tip`, shape (4, 4)."""
    pose = matrix_to_pose(tip)
    pose[:3] -= away * tip[:3, 2]
    return pose
