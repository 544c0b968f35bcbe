"""How a jaw may take hold of a thing that stands upright, or of a block in any attitude.

A grasp is a pose of the tip, shape (4, 4), whose z points along the closed fingers and whose y is the way the
left finger opens; the tip's origin is in the wrist yaw axis (robots.dvrk.instruments). Metres and radians,
poses in the world.
"""

from __future__ import annotations

from itertools import product
from math import asin, atan2, cos, pi, sin, sqrt, tan
from typing import NamedTuple

import numpy as np

from robots.training.boards import Ring
from robots.training.dishes import PIECE
from schemas.vectors import Vector

__all__ = ["AJAR", "FINGER", "FREE", "UPRIGHT", "Grasps", "of_piece", "of_ring"]

_BITE = 1.0e-3
"""How far from the ends of the fingers the edges of a block touch them, m."""
_ROOM = 2.0e-3
"""Between an open finger and the block on either side, m."""
_WIDEST = 1.39
"""Largest opening of the jaw, rad (robots.dvrk.instruments)."""
_DEPTH = 5.0e-3
"""How deep the fingers reach into a ring, m."""
_ASIDE = 3.5e-3
"""How far from the middle of a ring's wall they take it, m: away from the post, clear of the next wall."""
AJAR = 0.20
"""Opening with which a jaw comes down on the wall of a ring, rad."""
FINGER = (1.4e-3, 2.1e-3)
"""Thickness and half the width of a finger of a needle driver near its end, m (engines.mujoco.looks)."""
FREE = 0.3e-3
"""Between the finger in a ring and the post, m."""
_SAMPLES = 5
"""Points of the finger in a ring that are held against the post."""
UPRIGHT = cos(0.35)
"""Height of the axis of a thing that need not be put upright, over its length."""
_STEEP = 0.5
"""The same of the face of a block through which fingers reach for it."""


class Grasps(NamedTuple):
    """Ways to take hold of one thing."""

    poses: Vector
    """Of the tip, shape (n, 4, 4); none where the thing cannot be taken."""
    opening: Vector
    """Of the jaw before it closes, rad, shape (n,)."""
    outwards: Vector
    """Horizontal direction from the thing's middle to the grasp, shape (n, 2), of length 1 or, amid it, 0."""
    ups: Vector
    """Axis of the thing that is upright, or is to be before it is put down, shape (n, 3), in the world."""


def of_piece(pose: Vector, reach: float) -> Grasps:
    """Return the grasps of a block with `pose`, shape (4, 4), through each of its faces that looks upwards.

    The edges of that face come between the fingers, which are a wedge as long as the jaw is open: `reach` is
    their length. Either side that is narrow enough will do, and either finger on either side.
    """
    axes, half = pose[:3, :3], np.array(PIECE.size) / 2.0
    poses, openings, ups = list[Vector](), list[float](), list[Vector]()
    for face in range(3):
        up = axes[:, face] * (1.0 if axes[2, face] > 0.0 else -1.0)
        if up[2] < _STEEP:
            continue
        top = pose[:3, 3] + half[face] * up
        for side in (k for k in range(3) if k != face):
            wedge = asin(min(1.0, half[side] / (reach - _BITE)))
            over = half[side] / tan(wedge)
            opening = 2.0 * atan2(half[side] + _ROOM, over)
            if opening > _WIDEST:
                continue
            for way in (1.0, -1.0):
                poses.append(_reaching(top + over * up, -up, way * axes[:, side]))
                openings.append(opening)
                ups.append(up)
    return _grasps(poses, openings, [(0.0, 0.0)] * len(poses), ups)


def of_ring(
    ring: Ring, pose: Vector, reach: float, post: tuple[Vector, float] | None, lean: float = 0.0
) -> Grasps:
    """Return the grasps of an upright ring with `pose`, shape (4, 4): one finger in the hole, one outside.

    None of a ring that leans by more than `UPRIGHT`: see controllers.expert.fallen_rings.

    Args:
        ring: its measures.
        pose: its pose, m.
        reach: length of the fingers, m.
        post: the one it is around, if any: where it stands (x, y), m, and its radius, m.
        lean: of the fingers from the vertical, along the wall and to either side, rad: so a wrist comes
            nearer to its arm by `reach` times the sine.
    """
    poses, outwards = list[Vector](), list[tuple[float, float]]()
    if abs(float(pose[2, 2])) < UPRIGHT:
        return _grasps([], [], [], [])
    up = pose[:3, 2] * (1.0 if pose[2, 2] > 0.0 else -1.0)
    centre = pose[:3, 3] + ring.height / 2.0 * (up - [0.0, 0.0, 1.0])  # below the middle of its upper rim
    spin = atan2(pose[1, 1], pose[0, 1])  # of the corner on y
    middle, over = ring.inradius + ring.thickness / 2.0, ring.height / 2.0 + reach * cos(lean) - _DEPTH
    for k, side, leant in product(range(3), (-1.0, 1.0), (lean, -lean) if lean else (0.0,)):
        turn = spin + (2.0 * k + 1.0) * pi / 3.0  # opposite to a corner: the outward normal of a wall
        axes = np.array([[cos(turn), sin(turn)], [-sin(turn), cos(turn)]])
        # where the fingers end, along the wall: nowhere within the ring are they further aside than `_ASIDE`
        aside = side * (_ASIDE + _DEPTH * min(0.0, side * tan(leant)))
        if post is not None and not _is_beside(
            axes @ (post[0] - centre[:2]), post[1], middle, aside, leant, reach
        ):
            continue
        away = np.array([middle, aside]) @ axes
        wrist = np.array([middle, aside - reach * sin(leant)]) @ axes
        for way in (0.0, pi):
            poses.append(_downwards(centre + np.append(wrist, 0.0), over, turn + way, leant * cos(way)))
            outwards.append(tuple(away / sqrt(float(away @ away))))
    return _grasps(poses, [AJAR] * len(poses), outwards, [up] * len(poses))


def _is_beside(post: Vector, radius: float, middle: float, aside: float, lean: float, reach: float) -> bool:
    """Say whether the open finger in a ring, all along, keeps clear of a post that is higher than the ring.

    `post` is where it stands, `middle` and `aside` where the closed fingers end, from the ring's axis along
    the normal of the wall and along the wall; m.
    """
    for along in np.linspace(0.0, reach, _SAMPLES):
        inner = middle - (reach - along) * sin(AJAR / 2.0) - FINGER[0] / 2.0
        off = np.abs(post - [inner, aside - along * sin(lean)]) - [FINGER[0] / 2.0, FINGER[1] / cos(lean)]
        if np.linalg.norm(np.maximum(off, 0.0)) < radius + FREE:
            return False
    return True


def _grasps(
    poses: list[Vector], openings: list[float], outwards: list[tuple[float, float]], ups: list[Vector]
) -> Grasps:
    return Grasps(
        np.array(poses).reshape(-1, 4, 4),
        np.array(openings),
        np.array(outwards, np.float64).reshape(-1, 2),
        np.array(ups).reshape(-1, 3),
    )


def _reaching(origin: Vector, fingers: Vector, opening: Vector) -> Vector:
    """Return the tip's pose at `origin` (m), whose fingers point along and open across these unit vectors."""
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([np.cross(opening, fingers), opening, fingers])
    pose[:3, 3] = origin
    return pose


def _downwards(point: Vector, over: float, turn: float, lean: float) -> Vector:
    """Return the tip's pose `over` (m) a point, with the fingers down, opening at `turn` (rad) from x.

    They lean by `lean` (rad) about the way they open: their ends to the left of it.
    """
    pose = np.eye(4)
    c, s, up, along = cos(turn), sin(turn), cos(lean), sin(lean)
    axes = np.array([[-s * up, c, -s * along], [c * up, s, c * along], [along, 0.0, -up]])
    pose[:3, :3] = axes + 0.0  # without -0.0, which a state hash would tell from 0.0
    pose[:3, 3] = point
    pose[2, 3] += over
    return pose
