"""Choice of the best grasp for a hand. SI units, poses in the world."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, pi, sin
from typing import NamedTuple

import numpy as np

from controllers.expert.grasps import AMPLE_ROOM, Grasps
from controllers.expert.hand import RobotHand
from controllers.expert.reach import links, margins, ways
from robots import rotation
from robots.transform import matrix_to_pose
from schemas.vectors import Vector

__all__ = ["GraspPlan", "plan", "plan_leaning", "upright"]

_COMFORT, _PER_TURN, _PER_OPENING, _PER_SIDE, _PER_ROOM = 0.25, 0.02, 0.2, 60.0, 100.0
"""Score of a grasp, in joint margins: margin without further benefit; cost of a radian of turning and of a
radian of jaw opening; worth of a metre away from the other hand and of a metre of clearance.
"""
_LEAST, _LEAST_LEANING = 0.01, 0.04
"""Least margins of a feasible grasp: 1.2 mm of insertion; 5 mm for a fallen object, where contact may push
the hand aside and a correction takes up to 4 mm.
"""
_FEW = 24
"""Number of grasps of a fallen object examined in detail, the best reachable first."""
_HEADINGS = tuple(2.0 * pi * k / 12.0 for k in range(12))
"""Rotations about the vertical of a fallen object at its target, rad."""


class GraspPlan(NamedTuple):
    """A planned grasp."""

    grasp: Vector
    """Pose of the tip, shape (7,)."""
    opening: float
    """Jaw opening before the grasp, rad."""
    up: Vector
    """Axis of the object to be upright at its target, shape (3,)."""
    leans: bool
    """Whether the object must be put upright first."""
    upright: Vector
    """Orientation of the tip with the object upright, quaternion (x, y, z, w)."""


def plan(
    hand: RobotHand, found: Grasps, lift: float, way: Vector, away: Vector, room: Callable[[Vector], Vector]
) -> GraspPlan | None:
    """Return the best grasp of an upright object; None: no grasp is within reach.

    Args:
        hand: the acting hand.
        found: the grasps to choose from.
        lift: height of the lift, m.
        way: displacement from the object's place to the target, m, shape (3,).
        away: unit vector away from the other hand, shape (2,); 0: no preference.
        room: function from points of an instrument (see `links`), shape (n, points, 3), to their least
            clearance from obstacles, m, shape (n,).
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
    score += _PER_SIDE * found.outwards @ away + _PER_ROOM * (free - AMPLE_ROOM)
    best = int(score.argmax())
    if score[best] == -np.inf:
        return None
    pose = matrix_to_pose(found.poses[best])
    return GraspPlan(pose, float(found.opening[best]), found.ups[best], leans=False, upright=pose[3:])


def plan_leaning(
    hand: RobotHand, found: Grasps, middle: Vector, lift: float, rest: Vector
) -> GraspPlan | None:
    """Return the best grasp for putting a fallen object upright; None: no grasp is within reach.

    Args:
        hand: the acting hand.
        found: the grasps to choose from.
        middle: middle of the object, m.
        lift: height of the lift before the hand turns, m.
        rest: middle of the object at its release, m.
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
            tips[i, j, 3] = _pose_after_carrying(
                found.poses[k], middle, _heading_rotation(heading) @ upright(found.ups[k]), rest
            )
    tips[:, :, 2] = tips[:, :, 3]
    tips[:, :, 2, 2, 3] += lift
    reached = margins(hand.chain, hand.base, tips.reshape(-1, 4, 4, 4)).reshape(len(few), -1)
    i, j = np.unravel_index(int(reached.argmax()), reached.shape)
    if reached[i, j] <= _LEAST_LEANING:
        return None
    k = int(few[i])
    turned = rotation.from_matrix(tips[i, j, 3])
    return GraspPlan(
        matrix_to_pose(found.poses[k]), float(found.opening[k]), found.ups[k], leans=True, upright=turned
    )


def upright(axis: Vector) -> Vector:
    """Return the least rotation, shape (3, 3), from a unit vector to the vertical."""
    x, y, z = axis
    if z < -1.0 + 1e-9:
        return np.diag([1.0, -1.0, -1.0])
    turn = np.array([[0.0, 0.0, -x], [0.0, 0.0, -y], [x, y, 0.0]])
    return np.eye(3) + turn + turn @ turn / (1.0 + z)


def _heading_rotation(angle: float) -> Vector:
    c, s = cos(angle), sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _pose_after_carrying(tip: Vector, middle: Vector, turn: Vector, to: Vector) -> Vector:
    """Return a tip's pose after moving an object from `middle` to `to` (m) with the rotation `turn`."""
    pose = tip.copy()
    pose[:3, :3] = turn @ tip[:3, :3]
    pose[:3, 3] = to + turn @ (tip[:3, 3] - middle)
    return pose


def _turns(hand: RobotHand, tips: Vector) -> Vector:
    """Return the rotation angle from the commanded pose to each tip pose, rad."""
    now = rotation.conjugate(hand.line()[3:])
    turns = [rotation.log(rotation.product(rotation.from_matrix(tip), now)) for tip in tips]
    return np.linalg.norm(turns, axis=1)
