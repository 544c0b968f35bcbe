"""How a jaw may take hold of a thing that stands upright, or of a block in any attitude.

A grasp is a pose of the tip, shape (4, 4), whose z points along the closed fingers and whose y is the way the
left finger opens; the tip's origin is in the wrist yaw axis (robots.dvrk.instruments). Metres and radians,
poses in the world.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from math import asin, atan2, cos, pi, sin, sqrt, tan
from typing import NamedTuple

import numpy as np

from controllers.expert.outlines import gap
from robots.training.boards import Ring
from robots.training.dishes import PIECE
from schemas.vectors import Vector

__all__ = ["AJAR", "FINGER", "FREE", "ROOMY", "UPRIGHT", "Grasps", "of_piece", "of_ring", "shut_fingers"]

_BITE = 1.0e-3
"""How far from the ends of the fingers the edges of a block touch them, m."""
_ROOM = 2.0e-3
"""Between an open finger and the block on either side, m."""
_WIDEST = 1.39
"""Largest opening of the jaw, rad (robots.dvrk.instruments)."""
_DEPTH = 5.0e-3
"""How deep the fingers reach into a ring, m."""
_ASIDE = (-3.0e-3, -1.5e-3, 0.0, 1.5e-3, 3.0e-3)
"""How far from the middle of a ring's wall they may end, m."""
AJAR = 0.20
"""Opening with which a jaw comes down on the wall of a ring, rad."""
FINGER = (1.4e-3, 2.1e-3)
"""Thickness and half the width of a finger of a needle driver near its end, m (engines.mujoco.looks)."""
FREE = 0.3e-3
"""Least room between the fingers at a ring and the post, its other walls and other rings, m."""
ROOMY = 1.0e-3
"""Such room beyond which more is no better, m. A tip that comes down passes up to 0.5 mm beside its line."""
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
    """Horizontal way from the thing's middle to the grasp, m, shape (n, 2)."""
    ups: Vector
    """Axis of the thing that is upright, or is to be before it is put down, shape (n, 3), in the world."""
    room: Vector
    """Between the fingers and what they are not to touch, at most `ROOMY`, m, shape (n,)."""


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
    ring: Ring,
    pose: Vector,
    reach: float,
    post: tuple[Vector, float] | None,
    lean: float = 0.0,
    others: Sequence[Vector] = (),
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
        others: outlines of rings beside it and of another hand's fingers in it, corners (n, 2), m, which the
            fingers are not to touch.
    """
    poses, outwards, rooms = list[Vector](), list[tuple[float, float]](), list[float]()
    if abs(float(pose[2, 2])) < UPRIGHT:
        return _grasps([], [], [], [])
    up = pose[:3, 2] * (1.0 if pose[2, 2] > 0.0 else -1.0)
    centre = pose[:3, 3] + ring.height / 2.0 * (up - [0.0, 0.0, 1.0])  # below the middle of its upper rim
    spin = atan2(pose[1, 1], pose[0, 1])  # of the corner on y
    middle, over = ring.inradius + ring.thickness / 2.0, ring.height / 2.0 + reach * cos(lean) - _DEPTH
    for k, aside, leant in product(range(3), _ASIDE, (lean, -lean) if lean else (0.0,)):
        turn = spin + (2.0 * k + 1.0) * pi / 3.0  # opposite to a corner: the outward normal of a wall
        axes = np.array([[cos(turn), sin(turn)], [-sin(turn), cos(turn)]])
        finger = _Fingers(middle, aside, leant, reach)
        room = min(ROOMY, finger.to_walls(ring))
        if post is not None:
            room = min(room, finger.to_post(axes @ (post[0] - centre[:2]), post[1]))
        both = [outline @ axes + centre[:2] for outline in finger.outlines()]
        room = min([room, *(gap(one, other) for one, other in product(both, others))])
        if room < FREE:
            continue
        away = np.array([middle, aside]) @ axes
        wrist = np.array([middle, aside - reach * sin(leant)]) @ axes
        for way in (0.0, pi):
            poses.append(_downwards(centre + np.append(wrist, 0.0), over, turn + way, leant * cos(way)))
            outwards.append(tuple(away))
            rooms.append(room)
    return _grasps(poses, [AJAR] * len(poses), outwards, [up] * len(poses), rooms)


class _Fingers(NamedTuple):
    """A jaw that comes down on the wall of a ring, open by `AJAR`: points are (along normal, along wall), m.

    They are counted from the ring's axis.
    """

    middle: float
    """Where the closed fingers end, along the wall's normal, m."""
    aside: float
    """The same along the wall, m."""
    lean: float
    """From the vertical, rad."""
    reach: float
    """Their length, m."""

    def _inner(self, along: float) -> Vector:
        """Return the middle of the finger in the ring, `along` (m) from its end."""
        off = (self.reach - along) * sin(AJAR / 2.0) + FINGER[0] / 2.0
        return np.array([self.middle - off, self.aside - along * sin(self.lean)])

    def to_post(self, post: Vector, radius: float) -> float:
        """Return the room of the finger in the ring, all along, to a post that is higher than the ring."""
        half = [FINGER[0] / 2.0, FINGER[1] / cos(self.lean)]
        off = [np.abs(post - self._inner(along)) - half for along in np.linspace(0.0, self.reach, _SAMPLES)]
        return float(np.linalg.norm(np.maximum(off, 0.0), axis=1).min()) - radius

    def to_walls(self, ring: Ring) -> float:
        """Return its room to the other two walls.

        At a distance q (m) from the axis towards its wall the triangle of the hole is (2 r + q) / sqrt(3)
        wide to either side, r being its inradius.
        """
        ends = [self._inner(along) for along in (0.0, _DEPTH / cos(self.lean))]
        wide = [(2.0 * ring.inradius + end[0] - FINGER[0] / 2.0) / sqrt(3.0) - abs(end[1]) for end in ends]
        return (min(wide) - FINGER[1] / cos(self.lean)) * sqrt(0.75)

    def outlines(self) -> tuple[Vector, Vector]:
        """Return the outlines, shape (4, 2), of the ends of the finger in the ring and of the one outside."""
        half, thick = FINGER[1] / cos(self.lean), FINGER[0] / 2.0
        off = self.reach * sin(AJAR / 2.0) + thick
        corners = np.array([[-thick, -half], [thick, -half], [thick, half], [-thick, half]])
        inner, outer = (corners + np.array([self.middle + side, self.aside]) for side in (-off, off))
        return inner, outer


def shut_fingers(tip: Vector, reach: float, thickness: float) -> Vector:
    """Return the outline (4, 2), m, of fingers as long as `reach` at a tip (4, 4) around what is so thick."""
    ends = tip[:3, 3] + reach * tip[:3, 2]
    across, along = (FINGER[0] + thickness / 2.0) * tip[:3, 1], FINGER[1] * tip[:3, 0]
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
        np.full(len(poses), ROOMY) if rooms is None else np.array(rooms),
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
