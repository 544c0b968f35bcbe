"""Goals of environments: the test of a reached goal, and rewards. For a single goal, or for many at once.

A goal is a place, m, shape (..., 3), or (..., 4) with a fourth number to be matched: whether the receiving
hand holds the object. A goal of height or length alone has a single number.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, cast

import numpy as np
from numpy.typing import NDArray

__all__ = ["Reward", "Tolerance", "event_bonus", "reward"]

Reward = Literal["sparse", "shaped"]

WORTH = {
    "grasped": 0.5,
    "lifted": 0.5,
    "handed over": 1.0,
    "placed": 1.0,
    "cut": 0.5,
    "dropped": -1.0,
    "torn": -1.0,
}
"""Values of the task's events in the shaped reward. An event counts when first happening in an episode; a
loss counts each time.
"""
LENGTH = 0.1
"""m; a goal so far away costs 1 in the shaped reward."""


@dataclass(frozen=True)
class Tolerance:
    """Distance from a goal that is near enough, m."""

    across: float
    """Tolerance in the horizontal plane, or in distance if `along` is None."""
    along: float | None = None
    """Along z."""

    def is_reached(self, achieved: NDArray[Any], desired: NDArray[Any]) -> NDArray[np.bool_]:
        """Return whether goals of shape (..., size) are reached, shape (...)."""
        off = np.abs(achieved - desired)
        if self.along is None:
            near = distance(achieved, desired) < self.across
        else:
            near = (np.hypot(off[..., 0], off[..., 1]) < self.across) & (off[..., 2] < self.along)
        return near & (off[..., 3] < 0.5) if off.shape[-1] > 3 else near


def distance(achieved: NDArray[Any], desired: NDArray[Any]) -> NDArray[Any]:
    """Return how far places are apart, m, shape (...)."""
    found: NDArray[Any] = np.linalg.norm((achieved - desired)[..., :3], axis=-1)
    return found


def reward(
    kind: Reward,
    tolerance: Tolerance,
    achieved: NDArray[Any],
    desired: NDArray[Any],
    info: Mapping[str, Any] | Sequence[Mapping[str, Any]] | NDArray[Any],
) -> NDArray[np.float64]:
    """Return the rewards of steps, shape (...).

    sparse: 0 where the goal is reached, else -1. shaped: minus the distance in units of 0.1 m, plus the
    `bonus` in `info`.
    """
    if kind == "sparse":
        return np.where(tolerance.is_reached(achieved, desired), 0.0, -1.0)
    if isinstance(info, Mapping):
        extra: Any = info.get("bonus", 0.0)
    else:
        rows = cast("Sequence[Mapping[str, Any]]", info)
        extra = np.array([row.get("bonus", 0.0) for row in rows])
    return np.asarray(extra - distance(achieved, desired) / LENGTH, np.float64)


def event_bonus(events: Sequence[str], seen: set[str]) -> float:
    """Return the value of a step's kinds of events, and add the kinds to those `seen` in the episode."""
    total = 0.0
    for kind in events:
        worth = WORTH.get(kind, 0.0)
        if worth < 0.0 or kind not in seen:
            total += worth
        seen.add(kind)
    return total
