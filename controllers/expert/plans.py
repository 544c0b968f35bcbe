"""Which of all ways to take hold of a thing is best for a hand. SI units, poses in the world."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, pi, sin
from typing import NamedTuple

import numpy as np

from controllers.expert.grasps import ROOMY, Grasps
from controllers.expert.hand import Hand, pose_of
from controllers.expert.reach import links, margins, ways
from robots import rotation
from schemas.vectors import Vector

__all__ = ["Plan", "plan", "plan_leaning", "upright"]

_COMFORT, _PER_TURN, _PER_OPENING, _PER_SIDE, _PER_ROOM = 0.25, 0.02, 0.2, 60.0, 100.0
"""Of a grasp: the joints' margin beyond which more is no better; what a radian of turning and a radian of the
jaw's opening cost, and what a metre away from the other hand and a metre of room about the instrument are
worth, in margins.
"""
_LEAST, _LEAST_LEANING = 0.01, 0.04
"""The least margin of a way that is gone: 1.2 mm of insertion; 5 mm on a way to a thing that leans, where a
hand may be pushed aside and corrects by up to 4 mm.
"""
_FEW = 24
"""Ways to take hold of a fallen thing that are looked at in detail: those that are reached best."""
_HEADINGS = tuple(2.0 * pi * k / 12.0 for k in range(12))
"""Rotations about the vertical with which a fallen thing may be put down, rad."""


class Plan(NamedTuple):
    """How a thing is taken."""

    grasp: Vector
    """Pose of the tip, shape (7,)."""
    opening: float
    """Of the jaw before it closes, rad."""
    up: Vector
    """Axis of the thing that is upright, or is to be before it is put down, shape (3,)."""
    leans: bool
    """Whether it has to be put upright first."""
    upright: Vector
    """Orientation of the tip then: a quaternion."""


def plan(
    hand: Hand, found: Grasps, lift: float, way: Vector, away: Vector, room: Callable[[Vector], Vector]
) -> Plan | None:
    """Return the best of the grasps of an upright thing; None if the arm reaches none.

    Args:
        hand: that takes it.
        found: the grasps.
        lift: by how much it is lifted, m.
        way: from where it is to where it is put, m, shape (3,).
        away: direction from the other hand, of length 1, shape (2,); 0 if that does not matter.
        room: of points in an instrument, shape (n, points, 3), as `links` gives them: how far they all are
            from what stands around, m, shape (n,).
    """
    if not len(found.poses):
        return None
    tips = np.repeat(found.poses[:, None], 3, axis=1)
    tips[:, 1, 2, 3] += lift
    tips[:, 2, :3, 3] += way
    reached, q = ways(hand.chain, hand.base, tips)
    free = found.room.copy()
    for held in (q[:, 0], q[:, 2]):
        can = reached > _LEAST
        free[can] = np.minimum(free[can], room(links(hand.chain, hand.base, held[can])))
    score = np.where(reached > _LEAST, np.minimum(reached, _COMFORT), -np.inf)
    score -= _PER_TURN * _turns(hand, found.poses) + _PER_OPENING * found.opening
    score += _PER_SIDE * found.outwards @ away + _PER_ROOM * (free - ROOMY)
    best = int(score.argmax())
    if score[best] == -np.inf:
        return None
    pose = pose_of(found.poses[best])
    return Plan(pose, float(found.opening[best]), found.ups[best], leans=False, upright=pose[3:])


def plan_leaning(hand: Hand, found: Grasps, middle: Vector, lift: float, rest: Vector) -> Plan | None:
    """Return the best way to take a fallen thing and put it upright; None if the arm reaches none.

    Args:
        hand: that takes it.
        found: the grasps.
        middle: where the thing's middle is, m.
        lift: by how much it is lifted before the hand turns, m.
        rest: where its middle is when it is let go, m.
    """
    if not len(found.poses):
        return None
    raised = np.repeat(found.poses[:, None], 2, axis=1)
    raised[:, 1, 2, 3] += lift
    few = np.argsort(-margins(hand.chain, hand.base, raised), kind="stable")[:_FEW]
    tips = np.empty((len(few), len(_HEADINGS), 4, 4, 4))
    tips[:, :, :2] = raised[few, None]
    for i, k in enumerate(few.tolist()):
        for j, heading in enumerate(_HEADINGS):
            tips[i, j, 3] = _carried(found.poses[k], middle, _heading(heading) @ upright(found.ups[k]), rest)
    tips[:, :, 2] = tips[:, :, 3]
    tips[:, :, 2, 2, 3] += lift
    reached = margins(hand.chain, hand.base, tips.reshape(-1, 4, 4, 4)).reshape(len(few), -1)
    i, j = np.unravel_index(int(reached.argmax()), reached.shape)
    if reached[i, j] <= _LEAST_LEANING:
        return None
    k = int(few[i])
    turned = rotation.from_matrix(tips[i, j, 3])
    return Plan(pose_of(found.poses[k]), float(found.opening[k]), found.ups[k], leans=True, upright=turned)


def upright(axis: Vector) -> Vector:
    """Return the least rotation, shape (3, 3), that brings a unit vector to the vertical."""
    x, y, z = axis
    if z < -1.0 + 1e-9:
        return np.diag([1.0, -1.0, -1.0])
    turn = np.array([[0.0, 0.0, -x], [0.0, 0.0, -y], [x, y, 0.0]])
    return np.eye(3) + turn + turn @ turn / (1.0 + z)


def _heading(angle: float) -> Vector:
    c, s = cos(angle), sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _carried(tip: Vector, middle: Vector, turn: Vector, to: Vector) -> Vector:
    """Return a tip's pose after it has carried a thing from `middle` to `to` (m) and has turned it."""
    pose = tip.copy()
    pose[:3, :3] = turn @ tip[:3, :3]
    pose[:3, 3] = to + turn @ (tip[:3, 3] - middle)
    return pose


def _turns(hand: Hand, tips: Vector) -> Vector:
    """Return by how much the hand has to turn from where it is sent to each pose, rad."""
    now = rotation.conjugate(hand.line()[3:])
    turns = [rotation.log(rotation.product(pose_of(tip)[3:], now)) for tip in tips]
    return np.linalg.norm(turns, axis=1)
