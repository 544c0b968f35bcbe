"""How a stitch goes on from where the needle is: who does what next, or why it cannot. SI units, world."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, pi, radians

import numpy as np

from controllers.expert.hand import Hand, framed
from controllers.stitching.geometry import Stitch
from controllers.stitching.params import StitchParams
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

__all__ = ["WayOn", "is_inside", "way_on"]

_UNDER = 0.5e-3
"""m; a needle with a point so far under the skin is in the tissue."""
_BESIDE = 2.0e-3
"""m; of a needle in the tissue from its way: what pad and jaw can make good."""

_NEARLY = radians(5.0)
"""Of the arc: so much less than planned may have come out for the puller to take it."""


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
    picked_for: Phase = Phase.LIFT
    """What follows when the driver has taken the needle up: it is in the tissue, or it is not."""


def is_inside(params: StitchParams, needle: Vector) -> bool:
    """Return whether a needle, at a pose of shape (4, 4), is in the tissue."""
    return _lowest(params, needle) < -_UNDER


def _lowest(params: StitchParams, needle: Vector) -> float:
    """Return the height of its lowest point over the skin, m."""
    shape, pad = params.needle[1].shape, params.phantom.pose
    wire = shape.points(np.linspace(-shape.arc / 2.0, shape.arc / 2.0, 60))
    heights = (wire @ needle[:3, :3].T + needle[:3, 3] - pad[:3, 3]) @ pad[:3, 2]
    return float(heights.min())


def way_on(
    params: StitchParams, driver: Hand, puller: Hand, stitch: Stitch, needle: Vector, holder: float
) -> WayOn:
    """Plan `stitch` from where the needle is, shape (4, 4), in the jaw of arm number `holder` (0: none).

    Raises MotionError, with the number that fails, if there is no way.
    """
    holding = {driver.number: driver, puller.number: puller}.get(holder)
    if holder and holding is None:
        raise MotionError(f"PSM{holder:.0f} holds the needle, which is neither {driver.arm} nor {puller.arm}")
    low = _lowest(params, needle)
    inside, angle = low < -_UNDER, stitch.angle(needle)
    if inside:
        angle = _on_its_way(stitch, needle, angle)
        if holding is None:
            return _taken_again(params, driver, puller, stitch, needle, angle)
    raised = needle.copy()
    raised[:3, 3] += max(0.0, params.lift - low) * params.phantom.pose[:3, 2]
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


def _taken_again(
    params: StitchParams, driver: Hand, puller: Hand, stitch: Stitch, needle: Vector, angle: float
) -> WayOn:
    """Plan how a needle that the tissue alone holds, its tip at `angle` (rad), is taken hold of."""
    emerge, lift = params.emerge, params.lift
    grips = grips_of(puller, params.taken, stitch.needle)
    if angle > stitch.exit + emerge - _NEARLY:
        grip, margin = _chosen(puller, grips, [pulling(stitch, emerge, lift, angle)])
        return WayOn(Phase.COME, None, needle, angle, np.eye(4), grip, margin)
    require_room(params.grip, stitch, emerge)
    taking, pull_margin = _chosen(puller, grips, [pulling(stitch, emerge, lift)])
    drive = driving(stitch, emerge, lift, angle)
    grip, margin = _chosen(driver, grips_of(driver, params.grip, stitch.needle), [drive])
    margin = min(margin, pull_margin)
    return WayOn(Phase.HOVER, None, needle, angle, grip, taking, margin, Phase.ALIGN)


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
