"""Plans for reaching, for pieces and for tissue. Metres and radians in the world."""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt

import numpy as np

from learning.environments.environment import Environment
from learning.environments.oracles.waypoints import (
    Seen,
    Waypoint,
    WaypointPlan,
    high,
    move_object,
    over,
    yaw_of,
)
from robots.training.dishes import DISH, PIECE

__all__ = ["piece", "reach", "retraction"]

_FORCEPS = 15.5e-3
"""The same of Cadiere forceps (robots.dvrk.instruments), m."""
_BITE_PIECE = 5.0e-3
"""Distance between the ends of the fingers and the edges of a held piece, m: nearer to the ends sub-steps
of 1 ms lose the piece.
"""


def reach(_: Environment) -> WaypointPlan:
    """Return how to bring the tip to the goal."""
    return [(0, lambda seen: Waypoint(seen.goal, None, False))]


_EDGE = np.array([0.0474, 0.0, 0.0215])
"""Where a tip takes the edge of the liver's lobe, m."""
_LIFT = np.array([-0.4, 0.0, 0.93])
"""Direction of yielding of the edge, upwards."""


def retraction(_: Environment) -> WaypointPlan:
    """Return a plan to take the edge of the lobe and lift the edge to the goal's height."""
    return [
        (0, lambda _: Waypoint(_EDGE, None, False, near=1.5e-3)),
        (0, lambda _: Waypoint(_EDGE, None, True, wait=2, near=5e-3)),
        (
            0,
            lambda seen: Waypoint(
                seen["PSM1/tip/position"] + 0.7 * _LIFT * (seen.goal[0] - seen["tissue/lift"][0]), None, True
            ),
        ),
    ]


def piece(_: Environment) -> WaypointPlan:
    """Return how to carry the piece into the goal's dish."""
    half = PIECE.size[2] / 2.0
    fingers = _FORCEPS - _BITE_PIECE
    above, travel = half + sqrt(fingers**2 - (PIECE.size[0] / 2.0) ** 2), DISH.height + half + 6e-3

    def to(height: float, *, closed: bool, wait: int = 0, near: float = 1e-3) -> Callable[[Seen], Waypoint]:
        def waypoint(seen: Seen) -> Waypoint:
            place = seen["piece/position"] + [0.0, 0.0, height]
            return Waypoint(place, yaw_of(seen.matrix("piece")), closed, wait, near)

        return waypoint

    return [
        (0, to(above + 0.03, closed=False, near=4e-3)),
        (0, to(above, closed=False)),
        (0, to(above, closed=True, wait=2, near=4e-3)),
        (0, move_object("piece", "PSM1", lambda seen: high(seen, "piece", travel), near=4e-3)),
        (0, move_object("piece", "PSM1", lambda seen: over(seen, travel), near=4e-3)),
        (0, move_object("piece", "PSM1", lambda seen: over(seen, half + 1e-3), near=2e-3)),
        (0, lambda seen: Waypoint(seen["PSM1/tip/position"], None, False, wait=1)),
        (0, lambda seen: Waypoint(over(seen, travel + 0.04), None, False)),
    ]
