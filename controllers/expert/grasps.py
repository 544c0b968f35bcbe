"""Grasps of an upright ring, and of a block in any attitude.

A grasp is a pose of the tip, shape (4, 4): z along the closed fingers, y in the opening direction of the left
finger, origin on the wrist yaw axis (robots.dvrk.instruments). Metres and radians, poses in the world.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from math import asin, atan2, cos, pi, sin, sqrt, tan
from typing import NamedTuple

import numpy as np

from controllers.expert.outlines import outline_gap
from robots.training.boards import Ring
from robots.training.dishes import PIECE
from robots.transform import rigid_transform
from schemas.vectors import Vector

__all__ = [
    "AMPLE_ROOM",
    "FINGER_SIZE",
    "LEAST_ROOM",
    "RING_OPENING",
    "UPRIGHT_COSINE",
    "Grasps",
    "grasps_of_piece",
    "grasps_of_ring",
    "shut_fingers",
]

_BITE = 1.0e-3
"""Distance from the ends of the fingers to the edges of a block between the fingers, m."""
_ROOM = 2.0e-3
"""Gap between an open finger and the block on either side, m."""
_WIDEST = 1.39
"""Largest opening of the jaw, rad (robots.dvrk.instruments)."""
_DEPTH = 5.0e-3
"""Depth of the fingers in a ring, m."""
_ASIDE = (-3.0e-3, -1.5e-3, 0.0, 1.5e-3, 3.0e-3)
"""Offsets of the fingers from the middle of a ring's wall, along the wall, m."""
RING_OPENING = 0.20
"""Jaw opening for the descent on the wall of a ring, rad."""
FINGER_SIZE = (1.4e-3, 2.1e-3)
"""Thickness and half width of a finger of a needle driver near its end, m (engines.mujoco.looks)."""
LEAST_ROOM = 0.3e-3
"""Least clearance of the fingers at a ring from the post, the ring's other walls and other rings, m."""
AMPLE_ROOM = 1.0e-3
"""Clearance without further benefit, m. A tip in descent is up to 0.5 mm off its line."""
_SAMPLES = 5
"""Number of points of the finger in a ring checked against the post."""
UPRIGHT_COSINE = cos(0.35)
"""Cosine of the largest tilt of an object considered upright."""
_STEEP = 0.5
"""Cosine of the largest tilt of a block's face open to a grasp."""


class Grasps(NamedTuple):
    """Grasps of one object."""

    poses: Vector
    """Poses of the tip, shape (n, 4, 4); empty: no grasp."""
    opening: Vector
    """Jaw opening before the grasp, rad, shape (n,)."""
    outwards: Vector
    """Horizontal displacement from the object's middle to the grasp, m, shape (n, 2)."""
    ups: Vector
    """Axis of the object to be upright at its target, shape (n, 3), in the world."""
    room: Vector
    """Clearance of the fingers from obstacles, at most `AMPLE_ROOM`, m, shape (n,)."""


def grasps_of_piece(pose: Vector, reach: float) -> Grasps:
    """Return the grasps of a block with `pose`, shape (4, 4), through each of the block's upward faces.

    The edges of the face lie between the open fingers, a wedge of length `reach`. Both sides of the face and
    both assignments of fingers are considered.
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
                poses.append(_reaching_tip(top + over * up, -up, way * axes[:, side]))
                openings.append(opening)
                ups.append(up)
    return _grasps(poses, openings, [(0.0, 0.0)] * len(poses), ups)


def grasps_of_ring(
    ring: Ring,
    pose: Vector,
    reach: float,
    post: tuple[Vector, float] | None,
    lean: float = 0.0,
    others: Sequence[Vector] = (),
) -> Grasps:
    """Return the grasps of an upright ring with `pose`, shape (4, 4): a finger in the hole, a finger outside.

    For rings tilted by more than `UPRIGHT_COSINE` see controllers.expert.fallen_rings; the result is empty.

    Args:
        ring: measures of the ring.
        pose: pose of the ring, m.
        reach: length of the fingers, m.
        post: position (x, y) and radius of a post in the ring, m.
        lean: tilt of the fingers from the vertical, along the wall and to either side, rad. The wrist comes
            nearer to its arm by `reach` times the sine.
        others: outlines of obstacles (other rings, the fingers of the other hand), corners (n, 2), m.
    """
    poses, outwards, rooms = list[Vector](), list[tuple[float, float]](), list[float]()
    if abs(float(pose[2, 2])) < UPRIGHT_COSINE:
        return _grasps([], [], [], [])
    up = pose[:3, 2] * (1.0 if pose[2, 2] > 0.0 else -1.0)
    centre = pose[:3, 3] + ring.height / 2.0 * (up - [0.0, 0.0, 1.0])  # below the middle of its upper rim
    spin = atan2(pose[1, 1], pose[0, 1])  # of the corner on y
    middle, over = ring.inradius + ring.thickness / 2.0, ring.height / 2.0 + reach * cos(lean) - _DEPTH
    for k, aside, leant in product(range(3), _ASIDE, (lean, -lean) if lean else (0.0,)):
        turn = spin + (2.0 * k + 1.0) * pi / 3.0  # opposite to a corner: the outward normal of a wall
        axes = np.array([[cos(turn), sin(turn)], [-sin(turn), cos(turn)]])
        finger = _Fingers(middle, aside, leant, reach)
        room = min(AMPLE_ROOM, finger.to_walls(ring))
        if post is not None:
            room = min(room, finger.to_post(axes @ (post[0] - centre[:2]), post[1]))
        both = [outline @ axes + centre[:2] for outline in finger.outlines()]
        room = min([room, *(outline_gap(one, other) for one, other in product(both, others))])
        if room < LEAST_ROOM:
            continue
        away = np.array([middle, aside]) @ axes
        wrist = np.array([middle, aside - reach * sin(leant)]) @ axes
        for way in (0.0, pi):
            poses.append(_downward_tip(centre + np.append(wrist, 0.0), over, turn + way, leant * cos(way)))
            outwards.append(tuple(away))
            rooms.append(room)
    return _grasps(poses, [RING_OPENING] * len(poses), outwards, [up] * len(poses), rooms)


class _Fingers(NamedTuple):
    """A jaw on the wall of a ring, open by `RING_OPENING`.

    Points are (along the wall's normal, along the wall) from the ring's axis, m.
    """

    middle: float
    """End of the closed fingers along the wall's normal, m."""
    aside: float
    """End of the closed fingers along the wall, m."""
    lean: float
    """Tilt of the fingers from the vertical, rad."""
    reach: float
    """Length of the fingers, m."""

    def _inner_finger(self, along: float) -> Vector:
        """Return the middle of the finger in the ring, `along` (m) from its end."""
        off = (self.reach - along) * sin(RING_OPENING / 2.0) + FINGER_SIZE[0] / 2.0
        return np.array([self.middle - off, self.aside - along * sin(self.lean)])

    def to_post(self, post: Vector, radius: float) -> float:
        """Return the clearance between the whole inner finger and a post higher than the ring, m."""
        half = [FINGER_SIZE[0] / 2.0, FINGER_SIZE[1] / cos(self.lean)]
        off = [
            np.abs(post - self._inner_finger(along)) - half
            for along in np.linspace(0.0, self.reach, _SAMPLES)
        ]
        return float(np.linalg.norm(np.maximum(off, 0.0), axis=1).min()) - radius

    def to_walls(self, ring: Ring) -> float:
        """Return the clearance between the inner finger and the other two walls, m.

        At a distance q (m) from the axis towards a wall the triangular hole of inradius r has a half width of
        (2 r + q) / sqrt(3).
        """
        ends = [self._inner_finger(along) for along in (0.0, _DEPTH / cos(self.lean))]
        wide = [
            (2.0 * ring.inradius + end[0] - FINGER_SIZE[0] / 2.0) / sqrt(3.0) - abs(end[1]) for end in ends
        ]
        return (min(wide) - FINGER_SIZE[1] / cos(self.lean)) * sqrt(0.75)

    def outlines(self) -> tuple[Vector, Vector]:
        """Return the outlines, shape (4, 2), of the ends of the inner and the outer finger."""
        half, thick = FINGER_SIZE[1] / cos(self.lean), FINGER_SIZE[0] / 2.0
        off = self.reach * sin(RING_OPENING / 2.0) + thick
        corners = np.array([[-thick, -half], [thick, -half], [thick, half], [-thick, half]])
        inner, outer = (corners + np.array([self.middle + side, self.aside]) for side in (-off, off))
        return inner, outer


def shut_fingers(tip: Vector, reach: float, thickness: float) -> Vector:
    """Return the outline (4, 2), m, of fingers of length `reach` at a tip (4, 4), shut on a thickness (m)."""
    ends = tip[:3, 3] + reach * tip[:3, 2]
    across, along = (FINGER_SIZE[0] + thickness / 2.0) * tip[:3, 1], FINGER_SIZE[1] * tip[:3, 0]
    return np.array([(ends + i * across + j * along)[:2] for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))])


def _grasps(
    poses: list[Vector],
    openings: list[float],
    outwards: list[tuple[float, float]],
    ups: list[Vector],
    rooms: list[float] | None = None,
) -> Grasps:
    return Grasps(
        np.array(poses).reshape(-1, 4, 4),
        np.array(openings),
        np.array(outwards, np.float64).reshape(-1, 2),
        np.array(ups).reshape(-1, 3),
        np.full(len(poses), AMPLE_ROOM) if rooms is None else np.array(rooms),
    )


def _reaching_tip(origin: Vector, fingers: Vector, opening: Vector) -> Vector:
    """Return the tip's pose (4, 4) at `origin` (m) with unit vectors along the fingers and their opening."""
    return rigid_transform(np.column_stack([np.cross(opening, fingers), opening, fingers]), origin)


def _downward_tip(point: Vector, over: float, turn: float, lean: float) -> Vector:
    """Return the tip's pose `over` (m) a point, with the fingers down, opening at `turn` (rad) from x.

    The fingers are tilted by `lean` (rad) about the opening direction, with their ends to the left.
    """
    pose = np.eye(4)
    c, s, up, along = cos(turn), sin(turn), cos(lean), sin(lean)
    axes = np.array([[-s * up, c, -s * along], [c * up, s, c * along], [along, 0.0, -up]])
    pose[:3, :3] = axes + 0.0  # without -0.0, which a state hash would tell from 0.0
    pose[:3, 3] = point
    pose[2, 3] += over
    return pose
