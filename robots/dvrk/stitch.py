"""A stitch: how a curved needle goes through tissue, and the lattice of stitches that a study asks for.

The needle turns about the centre of its arc, its plane upright on the tissue. It comes in and goes out at the
same angle b to the surface, so the centre stands R cos b above it and the points are 2 R sin b apart. Its tip
goes from the point of entry to the point of exit and on until enough of it is out to be taken there. SI
units, radians.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from math import ceil, cos, pi, radians, sin

import numpy as np

from robots.dvrk.held_needle import Needle
from schemas.vectors import Vector

__all__ = ["EMERGE", "Stitch", "lattice", "path", "tissue"]

EMERGE = radians(15.0)
"""Length of the arc beyond the point of exit, rad: 3 mm of the needle, for another instrument to take."""
_STEP = radians(7.5)
"""Largest turn of the needle between points of a path."""

_DEPTH = 0.15
"""Distance of the middle of the tissue from the remote centre, straight down, m: reached half way along the
insertion's range.
"""
_TILTS = tuple(radians(angle) for angle in (0.0, 30.0, 60.0))
"""Tilt of the tissue against the plane across the shaft, about the base's y axis: instruments come in steeply
at best, and often flat.
"""
_PLACES = (-0.03, 0.0, 0.03)
"""Along either axis of the tissue, m: a patch of 60 mm."""
_DIRECTIONS = tuple(radians(30.0 * i) for i in range(12))
_ENTRIES = (radians(30.0), radians(45.0))
"""Angles to the surface: bites of 11.4 and 16.2 mm with a needle of 11.44 mm radius; more than 50 degrees
would not leave the handle of the arc outside.
"""
_HOLDS = (2.0 / 3.0, 5.0 / 6.0)
"""Where the needle is held, as parts of its arc behind the tip: about two thirds is what is taught; farther
back leaves more room.
"""


@dataclass(frozen=True)
class Stitch:
    """A stitch in tissue tilted, at a place on it and in a direction."""

    tilt: float
    """Tilt of the tissue, rad."""
    place: tuple[float, float]
    """Half way between entry and exit, on the tissue, m."""
    direction: float
    """Direction from entry to exit, about the tissue's normal, from the x axis on, rad."""
    entry: float
    """Angle between needle and surface at entry and exit, rad."""
    hold: float
    """Where the needle is held: part of its arc behind the tip."""


def lattice() -> tuple[Stitch, ...]:
    """Return all stitches of the study: every tilt with every place, direction, entry and hold."""
    places = tuple(product(_PLACES, _PLACES))
    return tuple(Stitch(*values) for values in product(_TILTS, places, _DIRECTIONS, _ENTRIES, _HOLDS))


def tissue(tilt: float) -> Vector:
    """Return the pose, shape (4, 4), of the tissue in the base frame: z outwards, origin in its middle."""
    pose = np.eye(4)
    pose[0, 0] = pose[2, 2] = cos(tilt)
    pose[0, 2] = sin(tilt)
    pose[2, 0] = -pose[0, 2]
    pose[2, 3] = -_DEPTH
    return pose


def path(stitch: Stitch, needle: Needle) -> Vector:
    """Return the poses of the needle, shape (n, 4, 4), in the arm's base frame.

    They begin when the tip touches the tissue, and end when it has emerged.
    """
    way = 2.0 * stitch.entry + EMERGE
    tip = np.linspace(pi / 2.0 - stitch.entry, pi / 2.0 - stitch.entry + way, ceil(way / _STEP - 1e-9) + 1)
    middle = tip - needle.arc / 2.0  # angle of the wire's middle, from the side of the entry downwards
    along = np.array([cos(stitch.direction), sin(stitch.direction), 0.0])
    normal, up = np.array([along[1], -along[0], 0.0]), np.array([0.0, 0.0, 1.0])
    poses = np.zeros((len(tip), 4, 4))
    poses[:, :3, 0] = -np.cos(middle)[:, None] * along - np.sin(middle)[:, None] * up
    poses[:, :3, 1] = np.sin(middle)[:, None] * along - np.cos(middle)[:, None] * up
    poses[:, :3, 2] = normal
    poses[:, :3, 3] = (*stitch.place, needle.radius * cos(stitch.entry))
    poses[:, 3, 3] = 1.0
    return tissue(stitch.tilt) @ poses
