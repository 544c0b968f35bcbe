"""Classes of failure: how far an episode came, and the instant that decided."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from learning.judge.happened import Happened

__all__ = ["FAILURES", "Failure", "classify"]

FAILURES: Mapping[str, str] = MappingProxyType(
    {
        "policy failed": "the policy gave no valid action: see the column error",
        "object lost": "an object fell out of the scene",
        "dropped": "an object was dropped and not taken up again",
        "torn": "tissue was torn",
        "never grasped": "nothing was ever grasped",
        "never handed over": "the object stayed in the first hand",
        "goal not reached": "time ran out on the way to the goal",
    }
)
"""Descriptions, by class."""


class Failure(NamedTuple):
    """Why an episode is no success."""

    kind: str
    """A class of `FAILURES`."""
    time_s: float
    """Simulated time of the decisive event, or of the end of the episode."""


def classify(happened: Happened, *, error: bool, grasps: bool, hands: int) -> Failure | None:
    """Return the failure of an episode; None for a success.

    Args:
        happened: the course of the episode.
        error: whether the policy failed.
        grasps: whether the exercise begins with a grasp.
        hands: number of hands that act.
    """
    counts, end = happened.counts, happened.time_s
    if error:
        return Failure("policy failed", end)
    if happened.succeeded:
        return None
    if happened.lost:
        return Failure("object lost", happened.last.get("dropped", end))
    if counts["torn"]:
        return Failure("torn", happened.first["torn"])
    if not grasps:
        return Failure("goal not reached", end)
    if not counts["grasped"]:
        return Failure("never grasped", end)
    if happened.last.get("dropped", -1.0) > happened.last["grasped"]:
        return Failure("dropped", happened.last["dropped"])
    if hands > 1 and not counts["handed over"]:
        return Failure("never handed over", end)
    return Failure("goal not reached", end)
