"""Plans for needles. Metres and radians in the world."""

from __future__ import annotations

from collections.abc import Callable
from math import atan2, cos, sin

import numpy as np

from learning.environments.environment import Environment
from learning.environments.oracles.waypoints import Seen, Waypoint, WaypointPlan, yaw_of
from schemas.vectors import Vector

__all__ = ["hand_over", "needle_pick"]

_NEEDLE = 11.44e-3
_BITE, _HIGH = 9.2e-3, 0.04
"""Height of a tip taking a needle on the table, and of a tip hovering above, m."""


def _needle(seen: Seen, height: float) -> tuple[Vector, float]:
    """Return a place over the middle of the needle, and the direction across the needle."""
    turn = seen.matrix("needle")
    place = seen["needle/position"] + turn[:, 0] * _NEEDLE
    return np.array([place[0], place[1], height]), yaw_of(turn)


def _to_needle(
    height: float, *, closed: bool, wait: int = 0, near: float = 1e-3
) -> Callable[[Seen], Waypoint]:
    return lambda seen: Waypoint(*_needle(seen, height), closed, wait, near)


def _carry_to_goal(seen: Seen, arm: str) -> Waypoint:
    """Bring the needle's middle to the goal."""
    place, _ = _needle(seen, 0.0)
    place[2] = (seen["needle/position"] + seen.matrix("needle")[:, 0] * _NEEDLE)[2]
    return Waypoint(seen[f"{arm}/tip/position"] + seen.goal[:3] - place, None, True)


def needle_pick(_: Environment) -> WaypointPlan:
    """Return a plan to take a needle by the middle and bring the middle to the goal."""
    return [
        (0, _to_needle(_HIGH, closed=False, near=4e-3)),
        (0, _to_needle(_BITE, closed=False)),
        (0, _to_needle(_BITE, closed=True, wait=2, near=4e-3)),
        (0, lambda seen: _carry_to_goal(seen, "PSM1")),
    ]


def hand_over(_: Environment) -> WaypointPlan:
    """Return a plan: PSM1 takes a needle by the middle, and PSM2 the needle's end from PSM1."""

    def meeting(_: Seen) -> Waypoint:
        return Waypoint(np.array([0.0, 0.0, 0.049]), 0.0, True)

    def end(seen: Seen, height: float, aside: float) -> tuple[Vector, float]:
        """Return a place over the needle's free end nearer to PSM2, and the direction across the needle."""
        turn = seen.matrix("needle")
        angle = -1.35
        ends = [
            seen["needle/position"] + turn @ (_NEEDLE * np.array([cos(a), sin(a), 0.0]))
            for a in (angle, -angle)
        ]
        k = int(ends[0][1] > ends[1][1])
        out = turn @ np.array([cos((angle, -angle)[k]), sin((angle, -angle)[k]), 0.0])
        return ends[k] + [aside, 0.0, height], atan2(out[1], out[0])

    def to_end(
        height: float, aside: float, *, closed: bool, wait: int = 0, near: float = 1e-3
    ) -> Callable[[Seen], Waypoint]:
        return lambda seen: Waypoint(*end(seen, height, aside), closed, wait, near)

    return [
        (0, _to_needle(_HIGH, closed=False, near=4e-3)),
        (0, _to_needle(_BITE, closed=False)),
        (0, _to_needle(_BITE, closed=True, wait=2, near=4e-3)),
        (0, meeting),
        (1, to_end(0.025, 0.0, closed=False, near=2e-3)),
        (1, to_end(8.6e-3, 0.0, closed=False)),
        (1, to_end(8.6e-3, 0.0, closed=True, wait=3, near=4e-3)),
        (0, lambda seen: Waypoint(seen["PSM1/tip/position"], None, False, wait=1)),
        (0, lambda _: Waypoint(np.array([-0.02, 0.0, 0.079]), None, False, near=0.03)),
        (1, lambda seen: _carry_to_goal(seen, "PSM2")),
    ]
