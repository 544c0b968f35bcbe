"""The tube of a suction irrigator."""

from __future__ import annotations

from math import cos, pi, sin

from engines.mujoco.looks.fingers import finger_frame
from engines.mujoco.looks.part import STEEL, Looks
from engines.mujoco.looks.solids import part, place_solid, rod
from robots.dvrk.end_effectors.end_effector import Mount
from robots.dvrk.end_effectors.suction_tube import SuctionTube

__all__ = ["parts"]

_HOLE = 0.0006
"""Radius of a hole beside the end, m."""
_ROWS, _HOLES = (0.0025, 0.0055), 4
"""Distances of the rows of holes from the end, m, and number of holes in a row."""


def parts(tube: SuctionTube, _instrument: str, mount: Mount) -> Looks:
    """Return a tube with an open end and two rows of holes."""
    pose, r, end = finger_frame(mount), tube.radius, tube.length
    solid = rod((0.0, 0.0, 0.0), (0.0, 0.0, end), r) - rod(
        (0.0, 0.0, 0.3 * end), (0.0, 0.0, 2.0 * end), tube.bore
    )
    for row, back in enumerate(_ROWS):
        for k in range(_HOLES):
            turn = 2.0 * pi * (k + 0.5 * row) / _HOLES
            out = (2.0 * r * cos(turn), 2.0 * r * sin(turn), end - back)
            solid = solid - rod((0.0, 0.0, end - back), out, _HOLE)
    return {mount.link: (part("tube", place_solid(solid, pose[:3, :3], pose[:3, 3]), STEEL),)}
