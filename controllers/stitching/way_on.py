"""How a stitch goes on from where the needle is: who does what next, or why it cannot. SI units, world."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, degrees, pi

import numpy as np

from controllers.expert.hand import Hand, framed
from controllers.stitching.geometry import Stitch
from controllers.stitching.params import StitchingParams
from controllers.stitching.phase import Phase
from controllers.stitching.plan import (
    BEFORE,
    DEEP,
    best_grip,
    driving,
    grips_of,
    pulling,
    require_room,
)
from robots.dvrk.cart import inverse_pose
from schemas.errors import MotionError
from schemas.vectors import Vector

__all__ = ["WayOn", "way_on"]

_UNDER = 0.5e-3
"""m; a needle with a point so far under the skin is in the tissue."""
_BESIDE = 2.0e-3
"""m; of a needle in the tissue from its way: what pad and jaw can make good."""


@dataclass(frozen=True)
class WayOn:
    """The first phase, and what it begins with."""

    phase: Phase
    holder: Hand | None
    needle: Vector
    """Where the needle is brought first, shape (4, 4)."""
    angle: float
    """Of its tip on its way, rad."""
    driver: Vector
    puller: Vector
    """How the hands hold the needle, as in a `Plan`."""
    margin: float


def way_on(
    params: StitchingParams, driver: Hand, puller: Hand, stitch: Stitch, needle: Vector, holder: float
) -> WayOn:
    """Plan `stitch` from where the needle is, shape (4, 4), in the jaw of arm number `holder` (0: none).

    Raises MotionError, with the number that fails, if there is no way.
    """
    holding = {driver.number: driver, puller.number: puller}.get(holder)
    if holder and holding is None:
        raise MotionError(f"PSM{holder:.0f} holds the needle, which is neither {driver.arm} nor {puller.arm}")
    up = params.phantom.pose[:3, 2]
    wire = stitch.needle.points(np.linspace(-stitch.needle.arc / 2.0, stitch.needle.arc / 2.0, 60))
    heights = (wire @ needle[:3, :3].T + needle[:3, 3] - params.phantom.pose[:3, 3]) @ up
    low = float(heights.min())
    inside, angle = low < -_UNDER, stitch.angle(needle)
    if inside:
        angle = _on_its_way(stitch, needle, angle)
        if holding is None:
            raise MotionError(
                f"no jaw holds the needle, which is in the tissue, its tip at {degrees(angle):.0f} degrees of"
                " its way; take hold of it with a hand, then resume"
            )
    raised = needle.copy()
    raised[:3, 3] += max(0.0, params.lift - low) * up
    over = stitch.entry - BEFORE
    emerge, lift = params.emerge, params.lift
    pull = pulling(stitch, emerge, lift)
    if holding is puller and inside:
        grip, margin = _kept(puller, needle, [pulling(stitch, emerge, lift, angle)])
        return WayOn(Phase.PULL, puller, stitch.pose(angle), angle, np.eye(4), grip, margin)
    taking, pull_margin = _chosen(puller, grips_of(puller, params.taken, stitch.needle), [pull])
    if holding is driver:
        grip = inverse_pose(needle) @ framed(driver.measured)
        require_room(_behind(grip, driver, stitch), stitch, emerge)
        drive = driving(stitch, emerge, lift, angle if inside else None)
        grip, margin = _kept(driver, needle, [drive] if inside else [[raised], drive])
        if not inside:
            return WayOn(Phase.LIFT, driver, raised, over, grip, taking, min(margin, pull_margin))
        phase = Phase.DRIVE if angle < stitch.exit + emerge else Phase.COME
        return WayOn(phase, driver, stitch.pose(angle), angle, grip, taking, min(margin, pull_margin))
    require_room(params.grip, stitch, emerge)
    drive, grips = driving(stitch, emerge, lift), grips_of(driver, params.grip, stitch.needle)
    if holding is puller:
        shown = stitch.pose(stitch.exit + emerge, lift)
        _, kept = _kept(puller, needle, [[shown]])
        grip, margin = _chosen(driver, grips, [[shown], drive])
        return WayOn(Phase.PRESENT, puller, shown, over, grip, taking, min(kept, margin, pull_margin))
    grip, margin = _chosen(driver, grips, [[raised, needle], drive])
    return WayOn(Phase.HOVER, None, needle, over, grip, taking, min(margin, pull_margin))


def _on_its_way(stitch: Stitch, needle: Vector, angle: float) -> float:
    """Return the angle of a needle in the tissue, on from its entry. Raises MotionError if it is beside."""
    wanted, marks = stitch.pose(angle), stitch.needle.marks
    off = marks @ (needle[:3, :3] - wanted[:3, :3]).T + needle[:3, 3] - wanted[:3, 3]
    beside = float(np.sqrt((off * off).sum(axis=1).max()))
    if beside > _BESIDE:
        raise MotionError(
            f"the needle is in the tissue and {beside * 1e3:.1f} mm beside its way, allowed are"
            f" {_BESIDE * 1e3:.0f}; lead it back, or pull it out"
        )
    return angle + 2.0 * pi if angle < stitch.entry - BEFORE else angle


def _behind(grip: Vector, hand: Hand, stitch: Stitch) -> float:
    """Return how far behind the tip (rad) a jaw holds the needle, by the pose of its tip in the needle's."""
    x, y, _ = (grip[:3, 3] + (hand.jaw.length - DEEP) * grip[:3, 2]).tolist()
    return stitch.needle.arc / 2.0 - atan2(y, x)


def _kept(hand: Hand, needle: Vector, ways: list[list[Vector]]) -> tuple[Vector, float]:
    """Return how the hand holds the needle now, and the margin with which it goes like that."""
    return _chosen(hand, [inverse_pose(needle) @ framed(hand.measured)], ways)


def _chosen(hand: Hand, grips: list[Vector], ways: list[list[Vector]]) -> tuple[Vector, float]:
    grip, worst, _ = best_grip(hand, grips, ways)
    if problem := worst.problem:
        raise MotionError(f"the stitch is not feasible: of {hand.arm}, {problem}")
    return grip, worst.margin
