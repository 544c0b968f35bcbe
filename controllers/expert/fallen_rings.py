"""How a jaw may take hold of a ring that lies on its side or leans on something: by a wall, from an open end.

One finger comes into the hole, one stays outside; both point along the wall, at an angle to the ring's axis,
as far down as the wrist allows. Metres and radians, poses in the world.
"""

from __future__ import annotations

from itertools import product
from math import cos, pi, sin, sqrt, tan
from typing import NamedTuple

import numpy as np

from controllers.expert.grasps import AJAR, FINGER, FREE, ROOMY, Grasps
from robots.dvrk.instruments import WRIST_RADIUS
from robots.training.boards import Ring
from schemas.vectors import Vector

__all__ = ["BESIDE", "Around", "of_fallen_ring"]

BESIDE = 10.0e-3
"""Way that the fingers go straight along themselves to a thing that leans, and back, m."""

_DEPTH = 4.0e-3
"""How deep the fingers reach into the ring, along its axis, m."""
_TILTS = tuple(np.radians([0.0, 15.0, 30.0, 45.0]))
"""Of the fingers against the ring's axis, in the plane of the wall, rad."""
_ASIDE = (-2.5e-3, 0.0, 2.5e-3)
"""How far from the middle of the wall the fingers end, m."""
_DOWN = 0.25
"""Least share of the fingers' length by which they point down."""
_OVER = 0.5e-3
"""Between the fingers' ends and what the ring lies on, m."""
_SAMPLES = 5
"""Points of each finger, and of its way, that are held against posts and walls."""


class Around(NamedTuple):
    """What stands around a ring, m, in the world."""

    floor: float
    """Height of what it lies on."""
    posts: Vector
    """Where upright posts stand, shape (n, 2)."""
    post_radius: float
    post_top: float
    """Height of their ends."""
    boxes: tuple[tuple[Vector, Vector], ...] = ()
    """Walls: least and greatest coordinates of each, shape (3,)."""


def of_fallen_ring(ring: Ring, pose: Vector, reach: float, around: Around) -> Grasps:
    """Return the grasps of a ring with any `pose`, shape (4, 4), that keep clear of what is `around` it.

    `reach` is the length of the fingers. The axis that is to be up is that of the end they come through.
    """
    axis, middle = pose[:3, 2], pose[:3, 3]
    poses, outwards, ups = list[Vector](), list[Vector](), list[Vector]()
    for end, k, tilt, aside in product((1.0, -1.0), range(3), _TILTS, _ASIDE):
        if not _fits(ring, tilt, aside, reach):
            continue
        turn = (2.0 * k + 0.5) * pi / 3.0  # of a wall's outward normal; a corner lies on y
        normal = pose[:3, :3] @ np.array([cos(turn), sin(turn), 0.0])
        out = end * axis
        for along in (np.cross(out, normal), np.cross(normal, out)):
            fingers = sin(tilt) * along - cos(tilt) * out
            if fingers[2] > -_DOWN:
                continue
            wall = (ring.inradius + ring.thickness / 2.0) * normal
            ends = middle + wall + aside * along + (ring.height / 2.0 - _DEPTH) * out
            if not _is_clear(ends, fingers, normal, reach, around):
                continue
            away = (ends - middle)[:2]
            for way in (1.0, -1.0):
                tip = np.eye(4)
                tip[:3, :3] = np.column_stack([np.cross(way * normal, fingers), way * normal, fingers])
                tip[:3, 3] = ends - reach * fingers
                poses.append(tip)
                outwards.append(away)
                ups.append(out)
    return Grasps(
        np.array(poses).reshape(-1, 4, 4),
        np.full(len(poses), AJAR),
        np.array(outwards).reshape(-1, 2),
        np.array(ups).reshape(-1, 3),
        np.full(len(poses), ROOMY),
    )


def _fits(ring: Ring, tilt: float, aside: float, reach: float) -> bool:
    """Say whether the open finger in the hole, whose end is `aside` (m), keeps clear of the other two walls.

    At a distance q (m) from the axis towards its wall the triangle of the hole is (2 r + q) / sqrt(3) wide to
    either side, r being its inradius.
    """
    inner = ring.inradius - reach * sin(AJAR / 2.0) - FINGER[0]
    room = (2.0 * ring.inradius + inner) / sqrt(3.0) - FINGER[1] / cos(tilt)
    return max(abs(aside), abs(aside - _DEPTH * tan(tilt))) <= room


def _is_clear(ends: Vector, fingers: Vector, normal: Vector, reach: float, around: Around) -> bool:
    """Say whether open fingers, as long as `reach`, whose ends meet at `ends`, and the wrist are clear.

    That is there, on the way of `BESIDE` to it, and on the way down to where that begins.
    """
    wrist, thick = ends - reach * fingers, FINGER[0] / 2.0
    if wrist[2] - WRIST_RADIUS < around.floor + FREE:
        return False
    sides = [ends + side * (reach * sin(AJAR / 2.0) + thick) * normal for side in (1.0, -1.0)]
    if min(side[2] for side in sides) - thick < around.floor + _OVER:
        return False
    shares = np.linspace(0.0, 1.0, _SAMPLES)
    lines = np.concatenate([side + shares[:, None] * (wrist - side) for side in sides])
    points = (lines - BESIDE * shares[:, None, None] * fingers).reshape(-1, 3)
    low = points[points[:, 2] - WRIST_RADIUS < around.post_top]
    gaps = np.linalg.norm(low[:, None, :2] - around.posts[None], axis=-1)
    if gaps.size and gaps.min() < around.post_radius + WRIST_RADIUS:
        return False
    return not any(
        bool(((points > least - WRIST_RADIUS) & (points < greatest + WRIST_RADIUS)).all(axis=1).any())
        for least, greatest in around.boxes
    )
