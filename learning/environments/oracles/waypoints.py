"""Policies through waypoints: to each until the tip is near enough, then to the next.

Metres and radians in the world.
"""

from __future__ import annotations

from collections.abc import Callable
from math import atan2, pi, remainder
from typing import NamedTuple

import numpy as np

from learning.environments.environment import Environment, Observation
from robots import rotation
from schemas.vectors import Vector

__all__ = [
    "REACH",
    "Oracle",
    "Seen",
    "Waypoint",
    "WaypointPlan",
    "high",
    "move_object",
    "over",
    "remaining",
    "yaw_of",
]

_STEP, _TURN = 10e-3, pi / 6.0
"""Displacement and turn of an action of 1."""
NEAR, _ALIGNED = 1.0e-3, 0.05
"""m and rad: when a waypoint is reached."""
_PATIENCE = 6
"""Steps after which twice the distance from a waypoint is near enough."""
REACH = 10.2e-3
"""Reach from the wrist's yaw axis to the ends of a needle driver's fingers, m."""


class Waypoint(NamedTuple):
    """Goal of a tip; a policy makes the waypoint anew at every step, from the observation."""

    position: Vector
    yaw: float | None
    """Yaw of the jaw's opening direction, rad, or opposite; None: as at present."""
    closed: bool
    wait: int = 0
    """Steps to stay there."""
    near: float = NEAR


class Seen:
    """An observation by names."""

    def __init__(self, layout: dict[str, slice], observation: Observation) -> None:
        self._layout, self._values = layout, np.asarray(observation["observation"], np.float64)
        self.goal = np.asarray(observation["desired_goal"], np.float64)

    def __getitem__(self, name: str) -> Vector:
        """Return a part of the observation."""
        return self._values[self._layout[name]]

    def matrix(self, thing: str) -> Vector:
        """Return the orientation of a tip or thing, shape (3, 3)."""
        return rotation.matrix(self[f"{thing}/orientation"])


WaypointPlan = list[tuple[int, Callable[[Seen], Waypoint]]]
"""Hands and their waypoints, in turn."""


class Oracle:
    """Follows the waypoints of a hand or, in turns, of two; the second hand then stays."""

    def __init__(self, env: Environment, plan: Callable[[Environment], WaypointPlan]) -> None:
        self._layout, self._hands = env.layout, env.exercise.hands
        self._plan = plan(env)
        self.at = self._waited = self._spent = 0
        """The number of the present waypoint, from 0."""
        self._jaws = [1.0] * len(self._hands)

    def __call__(self, observation: Observation) -> Vector:
        """Return the action of the next step, shape (5 hands,)."""
        seen = Seen(self._layout, observation)
        hand, waypoint = self._plan[self.at]
        goal = waypoint(seen)
        arm = self._hands[hand]
        off = goal.position - seen[f"{arm}/tip/position"]
        # what is held turns with the jaw
        turn = 0.0 if goal.yaw is None or goal.closed else remaining(seen.matrix(f"{arm}/tip"), goal.yaw)
        self._jaws[hand] = -1.0 if goal.closed else 1.0
        action = np.zeros((len(self._hands), 5))
        action[:, 4] = self._jaws
        action[hand, :3] = np.clip(off / _STEP, -1.0, 1.0)
        action[hand, 3] = np.clip(turn / _TURN, -1.0, 1.0)
        self._spent += 1
        near = goal.near * 2.0 ** (self._spent // _PATIENCE)
        if np.linalg.norm(off) < near and abs(turn) < _ALIGNED:
            self._waited += 1
            if self._waited > goal.wait and self.at < len(self._plan) - 1:
                self.at, self._waited, self._spent = self.at + 1, 0, 0
                return self(observation) if goal.wait == 0 else action.ravel()
        return action.ravel()


def remaining(tip: Vector, yaw: float) -> float:
    """Return the angle (rad) for the jaw to turn to open along `yaw`, either finger first."""
    return remainder(yaw - atan2(tip[1, 1], tip[0, 1]), pi)


def yaw_of(matrix: Vector, axis: int = 0) -> float:
    """Return the angle (rad) from the world's x axis of an axis of a rotation matrix, seen from above."""
    return atan2(matrix[1, axis], matrix[0, axis])


def move_object(
    thing: str, arm: str, place: Callable[[Seen], Vector], *, closed: bool = True, near: float = NEAR
) -> Callable[[Seen], Waypoint]:
    """Bring a held thing's middle to a place."""

    def to(seen: Seen) -> Waypoint:
        off = place(seen) - seen[f"{thing}/position"]
        return Waypoint(seen[f"{arm}/tip/position"] + off, None, closed, near=near)

    return to


def high(seen: Seen, thing: str, height: float) -> Vector:
    """Return where a thing is, at a height."""
    return np.array([*seen[f"{thing}/position"][:2], height])


def over(seen: Seen, height: float) -> Vector:
    """Return where the goal is, at a height."""
    return np.array([seen.goal[0], seen.goal[1], height])
