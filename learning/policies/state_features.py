"""Features of an observation for a network: offsets and relative turns instead of places in the world."""

from __future__ import annotations

from itertools import combinations
from math import cos, pi, remainder, sin

import numpy as np

from learning.environments.environment import Environment, Observation
from learning.environments.oracles.waypoints import Seen, yaw_of
from schemas.vectors import Vector

__all__ = ["UNIT", "StateFeatures", "offset"]

UNIT, _TURN = 10e-3, pi / 6.0
"""Displacement, m, and turn, rad, of an action of 1."""
_MULTIPLES = (1, 2, 3, 6)
"""Multiples of a turn: a jaw looks the same after half a turn, a ring after a third."""
_FINE = 5.0
"""Enlargement of small offsets."""


class StateFeatures:
    """Features of the observations of an environment, in units of an action.

    Large offsets appear three times: as such, cut off where an action is cut off, and enlarged.
    """

    def __init__(self, env: Environment) -> None:
        self._layout, self._hands = env.layout, env.exercise.hands
        names = [name.removesuffix("/position") for name in env.layout if name.endswith("/position")]
        self._things = [name for name in names if not name.endswith("/tip")]

    def __call__(self, observation: Observation) -> Vector:
        """Return the features, shape (n,)."""
        seen = Seen(self._layout, observation)
        achieved = np.asarray(observation["achieved_goal"], np.float64)[:3]
        parts = [*offset(seen.goal[:3] - achieved)]
        for hand in self._hands:
            parts += [seen[f"{hand}/tip/position"] / UNIT, seen[f"{hand}/jaw"]]
            parts += [_turns(_yaw(seen, hand))]
        for first, second in combinations(self._hands, 2):
            parts += [(seen[f"{second}/tip/position"] - seen[f"{first}/tip/position"]) / UNIT]
        for thing in self._things:
            turn = seen.matrix(thing)
            parts += [turn.ravel(), _turns(yaw_of(turn))]
            for hand in self._hands:
                parts += self._seen_by(seen, achieved, thing, hand)
        return np.concatenate(parts)

    @staticmethod
    def _seen_by(seen: Seen, achieved: Vector, thing: str, hand: str) -> list[Vector]:
        """Return a thing as seen by a hand."""
        tip, yaw = seen[f"{hand}/tip/position"], _yaw(seen, hand)
        off, angle = seen[f"{thing}/position"] - tip, yaw_of(seen.matrix(thing)) - yaw
        across = np.array([cos(yaw) * off[0] + sin(yaw) * off[1], cos(yaw) * off[1] - sin(yaw) * off[0]])
        nearest = [remainder(angle, pi), remainder(angle + pi / 2.0, pi), remainder(angle + _TURN, pi / 3.0)]
        return [
            *offset(off),
            *offset(achieved - tip),
            across / UNIT,
            seen[f"{thing}/held_by/{hand}"],
            _turns(angle),
            np.clip(np.array(nearest) / _TURN, -1.0, 1.0),
        ]


def _yaw(seen: Seen, hand: str) -> float:
    """Return the angle of a jaw's opening direction, rad."""
    return yaw_of(seen.matrix(f"{hand}/tip"), 1)


def offset(metres: Vector) -> list[Vector]:
    """Return an offset as such, cut off, and enlarged."""
    off = metres / UNIT
    return [off, np.clip(off, -1.0, 1.0), np.clip(_FINE * off, -1.0, 1.0)]


def _turns(angle: float) -> Vector:
    """Return sines and cosines of multiples of an angle, rad."""
    angles = angle * np.array(_MULTIPLES)
    return np.concatenate([np.sin(angles), np.cos(angles)])
