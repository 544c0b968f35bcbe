"""How each hand takes hold, for all stitches of a session; or why a stitch is not feasible. SI units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, radians

import numpy as np

from controllers.expert.hand import Hand
from controllers.stitching.feasibility import Reach, reach
from controllers.stitching.geometry import Grip, Stitch, grip_pose, stitch_between
from robots.training.needles import NeedleShape
from robots.training.phantoms import Phantom
from schemas.errors import MotionError
from schemas.vectors import Vector

__all__ = ["BEFORE", "BEYOND", "DEEP", "Plan", "make_plan", "make_stitch"]

BEFORE, BEYOND = radians(12.0), radians(8.0)
"""Of the arc: from a tip that is brought in line to the skin; from the last of the needle to the skin."""
DEEP = 1.0e-3
"""From the ends of the fingers to the wire that they hold, m."""
_STEP = radians(5.0)


@dataclass(frozen=True)
class Plan:
    """How the hands hold the needle, as poses of their tips in the needle's frame, shape (4, 4)."""

    driver: Vector
    puller: Vector
    margin: float
    """Least share of half a joint's range that is left on all ways."""


def make_stitch(phantom: Phantom, pose: Vector, number: int, needle: NeedleShape) -> Stitch:
    """Return the stitch through a pair of holes, in the world, counted from 1; `pose`: of the phantom.

    Raises MotionError if it is not feasible for this needle and pad, with the number that fails.
    """
    entry, leave = (pose @ holes[number - 1] for holes in (phantom.entries, phantom.exits))
    for name, hole in (("entry", phantom.entries[number - 1]), ("exit", phantom.exits[number - 1])):
        over = np.abs(hole[:2, 3]) - np.array(phantom.skin[:2]) / 2.0
        if (over > 0.0).any():
            raise MotionError(f"stitch {number}: its {name} is {over.max() * 1e3:.1f} mm beside the pad")
    try:
        stitch = stitch_between(entry[:3, 3], leave[:3, 3], pose[:3, 2], needle)
    except MotionError as error:
        raise MotionError(f"stitch {number}: {error}") from error
    if stitch.depth > phantom.skin[2]:
        raise MotionError(
            f"stitch {number} would be {stitch.depth * 1e3:.1f} mm deep, and the skin is"
            f" {phantom.skin[2] * 1e3:.1f} mm thick"
        )
    return stitch


def make_plan(
    driver: Hand,
    puller: Hand,
    stitches: Sequence[Stitch],
    start: Vector,
    *,
    held: float,
    taken: float,
    emerge: float,
    lift: float,
) -> Plan:
    """Return how to hold the needle, which lies at `start` (4, 4); the angles are those of the parameters.

    Raises MotionError if no grip will do, with the joint that fails.
    """
    needle = stitches[0].needle
    if held > needle.arc or emerge + stitches[0].exit - stitches[0].entry > held:
        raise MotionError(
            f"held {np.degrees(held):.0f} degrees behind its tip, the jaw would be driven into the skin: the"
            f" arc in the tissue and beyond is"
            f" {np.degrees(emerge + stitches[0].exit - stitches[0].entry):.0f} degrees, the needle's"
            f" {np.degrees(needle.arc):.0f}"
        )
    raised = start.copy()
    raised[:3, 3] -= lift * start[:3, 2]
    best = list[tuple[Vector, float]]()
    for hand, behind, ways in (
        (driver, held, [[raised, start], *(_driving(stitch, emerge, lift) for stitch in stitches)]),
        (puller, taken, [_pulling(stitch, emerge, lift) for stitch in stitches]),
    ):
        grips = [
            grip_pose(Grip(behind, left_outside=side), needle, hand.jaw.length - DEEP)
            for side in (False, True)
        ]
        found = [[reach(hand.chain, hand.base, np.array(way) @ grip) for way in ways] for grip in grips]
        worst = [min(each, key=lambda one: one.margin) for each in found]
        chosen = max(range(len(grips)), key=lambda i: worst[i].margin)
        _require(hand, worst[chosen], found[chosen].index(worst[chosen]) - (hand is driver))
        best.append((grips[chosen], worst[chosen].margin))
    return Plan(best[0][0], best[1][0], min(margin for _, margin in best))


def _driving(stitch: Stitch, emerge: float, lift: float) -> list[Vector]:
    """Return poses of the needle (4, 4) from over the skin to where it is taken."""
    angles = _angles(stitch.entry - BEFORE, stitch.exit + emerge)
    return [stitch.pose(angles[0], lift), *(stitch.pose(angle) for angle in angles)]


def _pulling(stitch: Stitch, emerge: float, lift: float) -> list[Vector]:
    """Return poses of the needle (4, 4) from where it is taken until it is out and raised."""
    angles = _angles(stitch.exit + emerge, stitch.out + BEYOND)
    return [*(stitch.pose(angle) for angle in angles), stitch.pose(angles[-1], lift)]


def _angles(start: float, end: float) -> list[float]:
    angles: list[float] = np.linspace(start, end, ceil((end - start) / _STEP) + 1).tolist()
    return angles


def _require(hand: Hand, found: Reach, way: int) -> None:
    if problem := found.problem:
        what = "the needle cannot be picked up" if way < 0 else f"stitch {way + 1} of these is not feasible"
        raise MotionError(f"{what}: of {hand.arm}, {problem}")
