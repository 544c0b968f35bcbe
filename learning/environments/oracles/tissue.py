"""Plans to burn a sheet off its bed, and to cut a strip. Metres and radians in the world."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from learning.environments.environment import Environment
from learning.environments.exercises import TissueCut
from learning.environments.oracles.waypoints import Seen, Waypoint, WaypointPlan
from schemas.vectors import Vector

__all__ = ["dissect", "tissue_cut"]

_FORCEPS, _HOOK = np.array([-0.5, 0.0, -0.8660254]), np.array([0.8660254, 0.0, -0.5])
"""Directions of the instruments' ends from their tips."""
_FINGERS, _HEEL = 15.5e-3, 14.9e-3
"""Distances of the ends of the fingers and of the heel of the hook from the tips."""
_FOOT = np.array([0.0, 0.9e-3, 0.0])
"""Offset of the middle of the hook's foot from its heel."""
_BITE, _UP = np.array([-9e-3, 0.0, -1.2e-3]), np.array([2e-3, 0.0, 7.2e-3])
"""Place of the ends of the fingers in the sheet, and way on which they draw it."""
_FIRST, _PITCH, _HEIGHT = -11e-3, 1.3e-3, -0.8e-3
"""Place of the hook's first track, distance between tracks, and height of all."""
_HALF, _PACE = 4.8e-3, 0.6e-3
"""Half length of a track, and way of a step."""
_TRACKS = 6


def dissect(_: Environment) -> WaypointPlan:
    """Return a plan to draw the sheet up, and to burn track after track until enough is free."""
    bite = _BITE - _FINGERS * _FORCEPS
    plan: WaypointPlan = [
        (1, lambda _: Waypoint(bite, None, False)),
        (1, lambda _: Waypoint(bite, None, True, wait=2, near=5e-3)),
        (1, lambda _: Waypoint(bite + _UP, None, True)),
        (0, lambda _: Waypoint(_tip_at(_FIRST - 2e-3, -_HALF), None, False)),
    ]
    return plan + [(0, _burn(place)) for place in _tracks()]


def _tracks() -> list[Vector]:
    """Return the places of the hook's tip, to and fro across the sheet."""
    across = np.linspace(-_HALF, _HALF, round(2.0 * _HALF / _PACE) + 1).tolist()
    return [
        _tip_at(_FIRST + track * _PITCH, y)
        for track in range(_TRACKS)
        for y in (across if track % 2 == 0 else reversed(across))
    ]


def _tip_at(x: float, y: float) -> Vector:
    """Return the place of the tip for the middle of the foot at (x, y)."""
    return np.array([x, y, _HEIGHT]) - _FOOT - _HEEL * _HOOK


def _burn(place: Vector) -> Callable[[Seen], Waypoint]:
    """Return a waypoint with power, or a stop without where enough is free."""

    def to(seen: Seen) -> Waypoint:
        if seen["tissue/freed"][0] >= seen.goal[0]:
            return Waypoint(seen["PSM1/tip/position"], None, False, wait=1000)
        return Waypoint(place, None, True, near=0.6e-3)

    return to


_FREE_END = np.array([-23e-3, 0.0, -6e-3])
"""Where a tip takes the free end of the strip, as the end hangs, m."""
_TAUT = np.array([-26e-3, 0.0, -2e-3])
"""Where the tip holds the strip taut, m."""
_GRIPPED, _STRETCH = 6e-3, 3e-3
"""Length of the strip in the jaws, and its stretch between jaws and fixed end, m."""


def tissue_cut(env: Environment) -> WaypointPlan:
    """Return a plan to take the strip's end, hold the strip taut, and cut in two bites."""
    exercise = env.exercise
    assert isinstance(exercise, TissueCut)
    half, free = 0.5 * exercise.length, exercise.length - _GRIPPED

    def at(depth: float, *, closed: bool) -> Callable[[Seen], Waypoint]:
        def waypoint(seen: Seen) -> Waypoint:
            off = seen.goal[0]
            place = off - half - _STRETCH * (exercise.length - off) / free
            return Waypoint(np.array([place, depth, -2e-3]), None, closed, wait=2 * closed, near=1.5e-3)

        return waypoint

    return [
        (1, lambda _: Waypoint(_FREE_END, None, False, near=1.5e-3)),
        (1, lambda _: Waypoint(_FREE_END, None, True, wait=2, near=5e-3)),
        (1, lambda _: Waypoint(_TAUT, None, True, near=1.5e-3)),
        (0, at(-40e-3, closed=False)),
        (0, at(-15e-3, closed=False)),
        (0, at(-15e-3, closed=True)),
        (0, at(-15e-3, closed=False)),
        (0, at(-9e-3, closed=False)),
        (0, at(-9e-3, closed=True)),
    ]
