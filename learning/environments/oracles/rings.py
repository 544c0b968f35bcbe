"""Plans for rings on a peg board. Metres and radians in the world."""

from __future__ import annotations

from collections.abc import Callable
from math import atan2, cos, pi, sin
from typing import cast

import numpy as np

from learning.environments.environment import Environment
from learning.environments.exercises import PegTransfer
from learning.environments.oracles.waypoints import (
    REACH,
    Seen,
    Waypoint,
    WaypointPlan,
    high,
    move_object,
    over,
    remaining,
)
from robots.training.boards import Ring
from schemas.plain_sum import plain_sum
from schemas.vectors import Vector

__all__ = ["bi_peg_transfer", "peg_transfer"]

_ROOM = 0.016
"""Distance between two hands at a ring, m."""
_DEPTH, _ASIDE = 5.0e-3, 3.5e-3
"""Depth of the fingers in a ring, and distance of a grasp from the middle of the wall, m."""


def _walls(ring: Ring, seen: Seen) -> list[tuple[Vector, float]]:
    """Return the grasps of a ring's walls: offsets from the middle, and opening directions."""
    turn, over = seen.matrix("ring"), ring.height / 2.0 + REACH - _DEPTH
    middle = ring.inradius + ring.thickness / 2.0
    found: list[tuple[Vector, float]] = []
    for k in range(3):
        normal = atan2(turn[1, 1], turn[0, 1]) + (2 * k + 1) * pi / 3.0
        for aside in (-_ASIDE, _ASIDE):
            x, y = middle * cos(normal) - aside * sin(normal), middle * sin(normal) + aside * cos(normal)
            found.append((np.array([x, y, over]), normal))
    return found


def _ring_plan(env: Environment, hand: int, side: Vector) -> WaypointPlan:
    """Return a hand's grasp of the ring: by the wall of least turn of the jaw, or on the hand's `side`."""
    arm = env.exercise.hands[hand]
    ring = cast("PegTransfer", env.exercise).task.params.board.measures.ring
    chosen: list[int] = []

    others = [hand for hand in env.exercise.hands if hand != arm]

    def crowding(seen: Seen, at: Vector) -> float:
        """Return how much another hand is in the way of a place on the ring."""
        off = [seen[f"{hand}/tip/position"] - seen["ring/position"] - at for hand in others]
        return 100.0 * plain_sum(max(0.0, _ROOM - float(np.linalg.norm(each[:2]))) for each in off)

    def grasp(seen: Seen, over: float) -> tuple[Vector, float]:
        walls = _walls(ring, seen)
        if not chosen:
            tip = seen.matrix(f"{arm}/tip")
            costs = [
                abs(remaining(tip, yaw)) - 100.0 * float(at[:2] @ side) + crowding(seen, at)
                for at, yaw in walls
            ]
            chosen.append(int(np.argmin(costs)))
        at, yaw = walls[chosen[0]]
        return seen["ring/position"] + at + [0.0, 0.0, over], yaw

    def to(over: float, *, closed: bool, wait: int = 0, near: float = 1e-3) -> Callable[[Seen], Waypoint]:
        return lambda seen: Waypoint(*grasp(seen, over), closed, wait, near)

    return [
        (hand, to(0.03, closed=False, near=3e-3)),
        (hand, to(0.016, closed=False, near=0.25e-3)),
        (hand, to(0.0, closed=False, near=0.8e-3)),
        (hand, to(0.0, closed=True, wait=2, near=4e-3)),
    ]


def peg_transfer(env: Environment) -> WaypointPlan:
    """Return a plan to carry the ring with a single hand to the goal's post."""
    board = cast("PegTransfer", env.exercise).task.params.board
    travel = board.position[2] + board.measures.post_height + board.measures.ring.height / 2.0 + 4e-3
    return [
        *_ring_plan(env, 0, np.zeros(2)),
        (0, move_object("ring", "PSM1", lambda seen: high(seen, "ring", travel), near=4e-3)),
        (0, move_object("ring", "PSM1", lambda seen: over(seen, travel), near=1.2e-3)),
        (0, move_object("ring", "PSM1", lambda seen: over(seen, seen.goal[2]), near=1.5e-3)),
        (0, lambda seen: Waypoint(seen["PSM1/tip/position"], None, False, wait=1)),
        (0, lambda seen: Waypoint(over(seen, travel + 0.03), None, False)),
    ]


def bi_peg_transfer(env: Environment) -> WaypointPlan:
    """Return how PSM2 takes the ring over the wall, and PSM1 to the goal's post."""
    board = cast("PegTransfer", env.exercise).task.params.board
    pose, measures = board.pose, board.measures
    assert measures.wall is not None
    foot = pose[:3, :3] @ np.array([*measures.wall.centre, 0.0]) + pose[:3, 3]
    half = measures.ring.height / 2.0
    travel = foot[2] + measures.wall.size[2] + half + 8e-3
    low = foot[2] + measures.post_height + half + 4e-3
    meeting = np.array([foot[0] - 0.02, foot[1], travel])  # where both wrists have room
    left = np.array([1.0, 0.0])
    return [
        *_ring_plan(env, 1, left),
        (1, move_object("ring", "PSM2", lambda seen: high(seen, "ring", travel), near=4e-3)),
        (1, move_object("ring", "PSM2", lambda _: meeting, near=2e-3)),
        *_ring_plan(env, 0, -left),
        (1, lambda seen: Waypoint(seen["PSM2/tip/position"], None, False, wait=1)),
        (1, lambda _: Waypoint(meeting + np.array([0.02, 0.0, 0.05]), None, False, near=0.02)),
        (1, lambda _: Waypoint(meeting + np.array([0.06, 0.0, 0.03]), None, False, near=0.02)),
        (0, move_object("ring", "PSM1", lambda seen: over(seen, travel), near=2e-3)),
        (0, move_object("ring", "PSM1", lambda seen: over(seen, low), near=1.2e-3)),
        (0, move_object("ring", "PSM1", lambda seen: over(seen, seen.goal[2]), near=1.5e-3)),
        (0, lambda seen: Waypoint(seen["PSM1/tip/position"], None, False, wait=1)),
        (0, lambda seen: Waypoint(over(seen, low + 0.03), None, False)),
    ]
