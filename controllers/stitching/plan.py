"""How each hand takes hold, for all stitches of a session; or why a stitch is not feasible. SI units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, radians

import numpy as np

from controllers.expert.hand import RobotHand
from controllers.stitching.feasibility import ArmReach, best_reach
from controllers.stitching.geometry import Grip, Stitch, grip_pose, stitch_between
from robots.training.needles import NeedleShape
from robots.training.phantoms import Phantom
from schemas.errors import MotionError
from schemas.vectors import Vector

__all__ = [
    "BEFORE",
    "BEYOND",
    "DEEP",
    "GripPlan",
    "best_grip",
    "driving_poses",
    "grips_of",
    "make_plan",
    "make_stitch",
    "pulling_poses",
    "require_room",
    "stitch_through",
]

BEFORE, BEYOND = radians(12.0), radians(8.0)
"""Arcs: from a tip in line to the skin; from the end of the needle to the skin."""
DEEP = 1.0e-3
"""Distance from the ends of the fingers to a held wire, m."""
_STEP = radians(5.0)


@dataclass(frozen=True)
class GripPlan:
    """How the hands hold the needle, as poses of their tips in the needle's frame, shape (4, 4)."""

    driver: Vector
    puller: Vector
    margin: float
    """Least share of half a joint's range left on all ways."""


def make_stitch(phantom: Phantom, pose: Vector, number: int, needle: NeedleShape) -> Stitch:
    """Return the stitch through a pair of holes, in the world, counted from 1; `pose`: pose of the phantom.

    Raises MotionError if the stitch is not feasible for this needle and pad, with the number that fails.
    """
    entry, leave = (holes[number - 1, :3, 3] for holes in (phantom.entries, phantom.exits))
    return stitch_through(phantom, pose, entry, leave, needle, f"stitch {number}")


def stitch_through(
    phantom: Phantom, pose: Vector, entry: Vector, leave: Vector, needle: NeedleShape, name: str
) -> Stitch:
    """Return the stitch through two points of the skin, shape (3,), in the phantom's frame.

    Raises MotionError, beginning with `name`, if the stitch is not feasible for this needle and pad.
    """
    for end, point in (("entry", entry), ("exit", leave)):
        over = np.abs(point[:2]) - np.array(phantom.skin[:2]) / 2.0
        if (over > 0.0).any():
            raise MotionError(f"{name}: its {end} is {over.max() * 1e3:.1f} mm beside the pad")
    there, out = (pose @ [*point, 1.0] for point in (entry, leave))
    try:
        stitch = stitch_between(there[:3], out[:3], pose[:3, 2], needle)
    except MotionError as error:
        raise MotionError(f"{name}: {error}") from error
    if stitch.depth > phantom.skin[2]:
        raise MotionError(
            f"{name} would be {stitch.depth * 1e3:.1f} mm deep, and the skin is"
            f" {phantom.skin[2] * 1e3:.1f} mm thick"
        )
    return stitch


def make_plan(
    driver: RobotHand,
    puller: RobotHand,
    stitches: Sequence[Stitch],
    start: Vector,
    *,
    held: float,
    taken: float,
    emerge: float,
    lift: float,
) -> GripPlan:
    """Return the holds for a needle at `start` (4, 4), with the angles of the parameters.

    Raises MotionError if no grip will do, with the joint that fails.
    """
    needle = stitches[0].needle
    require_room(held, stitches[0], emerge)
    raised = start.copy()
    raised[:3, 3] -= lift * start[:3, 2]
    best = list[tuple[Vector, float]]()
    for hand, behind, ways in (
        (driver, held, [[raised, start], *(driving_poses(stitch, emerge, lift) for stitch in stitches)]),
        (puller, taken, [pulling_poses(stitch, emerge, lift) for stitch in stitches]),
    ):
        grip, worst, way = best_grip(hand, grips_of(hand, behind, needle), ways)
        _require(hand, worst, way - (hand is driver))
        best.append((grip, worst.margin))
    return GripPlan(best[0][0], best[1][0], min(margin for _, margin in best))


def require_room(held: float, stitch: Stitch, emerge: float) -> None:
    """Raise MotionError if a jaw `held` rad behind the tip would be driven into the skin."""
    inside = emerge + stitch.exit - stitch.entry
    if held > stitch.needle.arc or inside > held:
        raise MotionError(
            f"held {np.degrees(held):.0f} degrees behind its tip, the jaw would be driven into the skin: the"
            f" arc in the tissue and beyond is {np.degrees(inside):.0f} degrees, the needle's"
            f" {np.degrees(stitch.needle.arc):.0f}"
        )


def grips_of(hand: RobotHand, behind: float, needle: NeedleShape, *, backwards: bool = False) -> list[Vector]:
    """Return both holds of the needle `behind` its tip (rad), as in a `GripPlan`, from the same side."""
    length = hand.jaw.length - DEEP
    return [grip_pose(Grip(behind, side, backwards), needle, length) for side in (False, True)]


def best_grip(
    hand: RobotHand, grips: Sequence[Vector], ways: Sequence[Sequence[Vector]]
) -> tuple[Vector, ArmReach, int]:
    """Return the grip with the most room on its worst way, the reach on that way, and the grip's number."""
    found = [[best_reach(hand.chain, hand.base, np.array(way) @ grip) for way in ways] for grip in grips]
    worst = [min(each, key=lambda one: one.margin) for each in found]
    chosen = max(range(len(grips)), key=lambda i: worst[i].margin)
    return grips[chosen], worst[chosen], found[chosen].index(worst[chosen])


def driving_poses(stitch: Stitch, emerge: float, lift: float, start: float | None = None) -> list[Vector]:
    """Return poses of the needle (4, 4) from over the skin, or from `start` (rad), to the take-over."""
    end = stitch.exit + emerge
    if start is not None:
        return [stitch.pose(angle) for angle in _path_angles(min(start, end), end)]
    angles = _path_angles(stitch.entry - BEFORE, end)
    return [stitch.pose(angles[0], lift), *(stitch.pose(angle) for angle in angles)]


def pulling_poses(stitch: Stitch, emerge: float, lift: float, start: float | None = None) -> list[Vector]:
    """Return poses of the needle (4, 4) from the take-over, or `start`, until out and raised."""
    end = stitch.base_out_angle + BEYOND
    angles = _path_angles(stitch.exit + emerge if start is None else min(start, end), end)
    return [*(stitch.pose(angle) for angle in angles), stitch.pose(angles[-1], lift)]


def _path_angles(start: float, end: float) -> list[float]:
    angles: list[float] = np.linspace(start, end, ceil((end - start) / _STEP) + 1).tolist()
    return angles


def _require(hand: RobotHand, found: ArmReach, way: int) -> None:
    if problem := found.failure_reason:
        what = "the needle cannot be picked up" if way < 0 else f"stitch {way + 1} of these is not feasible"
        raise MotionError(f"{what}: of {hand.arm}, {problem}")
