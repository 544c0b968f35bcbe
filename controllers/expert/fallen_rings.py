"""Grasps of a ring on its side or leaning on an obstacle: by a wall, from an open end.

One finger is in the hole, one outside; both point along the wall, at an angle to the ring's axis, as far down
as the wrist allows. Metres and radians, poses in the world.
"""

from __future__ import annotations

from itertools import product
from math import cos, pi, sin, sqrt, tan
from typing import NamedTuple

import numpy as np

from controllers.expert.grasps import AMPLE_ROOM, FINGER_SIZE, LEAST_ROOM, RING_OPENING, Grasps
from robots.dvrk.instruments import WRIST_RADIUS
from robots.training.boards import Ring
from robots.transform import rigid_transform
from schemas.vectors import Vector

__all__ = ["BESIDE", "Around", "grasps_of_fallen_ring"]

BESIDE = 10.0e-3
"""Length of the straight approach along the fingers to a fallen object, and of the retreat, m."""

_DEPTH = 4.0e-3
"""Depth of the fingers in the ring, along the ring's axis, m."""
_TILTS = tuple(np.radians([0.0, 15.0, 30.0, 45.0]))
"""Angles between the fingers and the ring's axis, in the plane of the wall, rad."""
_ASIDE = (-2.5e-3, 0.0, 2.5e-3)
"""Offsets of the fingers' ends from the middle of the wall, m."""
_DOWN = 0.25
"""Least downward component of the fingers' direction."""
_OVER = 0.5e-3
"""Gap between the fingers' ends and the ground under the ring, m."""
_SAMPLES = 5
"""Number of points of each finger and of its approach checked against posts and walls."""


class Around(NamedTuple):
    """Obstacles around a ring, m, in the world."""

    floor: float
    """Height of the ground under the ring."""
    posts: Vector
    """Positions of upright posts, shape (n, 2)."""
    post_radius: float
    post_top: float
    """Height of the posts' upper ends."""
    boxes: tuple[tuple[Vector, Vector], ...] = ()
    """Walls: least and greatest coordinates of each, shape (3,)."""


def grasps_of_fallen_ring(ring: Ring, pose: Vector, reach: float, around: Around) -> Grasps:
    """Return the grasps of a ring with any `pose`, shape (4, 4), clear of obstacles.

    `reach` is the length of the fingers. The end of the ring with the fingers is to be the upper end.
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
                turn = np.column_stack([np.cross(way * normal, fingers), way * normal, fingers])
                poses.append(rigid_transform(turn, ends - reach * fingers))
                outwards.append(away)
                ups.append(out)
    return Grasps(
        np.array(poses).reshape(-1, 4, 4),
        np.full(len(poses), RING_OPENING),
        np.array(outwards).reshape(-1, 2),
        np.array(ups).reshape(-1, 3),
        np.full(len(poses), AMPLE_ROOM),
    )


def _fits(ring: Ring, tilt: float, aside: float, reach: float) -> bool:
    """Return whether the inner finger, with its end `aside` (m), is clear of the other two walls.

    At a distance q (m) from the axis towards a wall the triangular hole of inradius r has a half width of
    (2 r + q) / sqrt(3).
    """
    inner = ring.inradius - reach * sin(RING_OPENING / 2.0) - FINGER_SIZE[0]
    room = (2.0 * ring.inradius + inner) / sqrt(3.0) - FINGER_SIZE[1] / cos(tilt)
    return max(abs(aside), abs(aside - _DEPTH * tan(tilt))) <= room


def _is_clear(ends: Vector, fingers: Vector, normal: Vector, reach: float, around: Around) -> bool:
    """Return whether open fingers of length `reach`, closing at `ends`, and the wrist are clear of obstacles.

    Checked are the grasp, the straight approach (`BESIDE`) and the descent to the approach.
    """
    wrist, thick = ends - reach * fingers, FINGER_SIZE[0] / 2.0
    if wrist[2] - WRIST_RADIUS < around.floor + LEAST_ROOM:
        return False
    sides = [ends + side * (reach * sin(RING_OPENING / 2.0) + thick) * normal for side in (1.0, -1.0)]
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
