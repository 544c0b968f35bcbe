"""How a stitch goes on from the present place of the needle, or why it cannot. SI units, world."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, pi, radians
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controllers.expert.hand import RobotHand
from controllers.stitching.feasibility import ArmReach
from controllers.stitching.geometry import Stitch
from controllers.stitching.params import StitchParams
from controllers.stitching.phase import StitchPhase
from controllers.stitching.plan import (
    BEFORE,
    DEEP,
    best_grip,
    driving_poses,
    grips_of,
    pulling_poses,
    require_room,
)
from robots.transform import inverse_transform, pose_to_matrix
from schemas.errors import MotionError
from schemas.vectors import Vector

__all__ = [
    "HandOver",
    "WayOn",
    "behind_tip",
    "in_tissue",
    "is_inside",
    "present_grip",
    "raise_needle",
    "way_on",
]

_UNDER = 0.5e-3
"""Least depth of a point of a needle in the tissue, m."""
_BESIDE = 2.0e-3
"""m; deviation of a needle in the tissue that pad and jaw can make good."""

_NEARLY = radians(5.0)
"""Arc by which less than planned may have come out for the puller to take hold."""


class HandOver(NamedTuple):
    """From the giving hand to the taking hand."""

    needle: Vector
    """Where the needle is given, shape (4, 4)."""
    grip: Vector
    """Grip of the taking hand, as in a `GripPlan`."""


@dataclass(frozen=True)
class WayOn:
    """The first phase, with the needle's pose and the parts of the hands."""

    phase: StitchPhase
    holder: RobotHand | None
    needle: Vector
    """Where the needle is brought first, shape (4, 4)."""
    angle: float
    """Angle of the needle's tip on its way, rad."""
    driver: Vector
    puller: Vector
    """How the hands hold the needle, as in a `GripPlan`."""
    margin: float
    picked_for: StitchPhase = StitchPhase.LIFT
    """Phase after the needle has been taken up: in the tissue, or not."""
    exchanged: bool = False
    """Whether the arms have exchanged their planned parts."""
    alone: bool = False
    """Whether the driving arm also pulls: lets go, and takes hold anew."""
    handed: tuple[HandOver, ...] = ()
    """Hand-overs between the first phase and the way, in turn."""
    pick: Vector | None = None
    """Grip for picking the needle up, if different from the driver's hold."""


def is_inside(params: StitchParams, needle: Vector) -> bool:
    """Return whether a needle, at a pose of shape (4, 4), is in the tissue."""
    return bool(in_tissue(params, _wire_points(params, needle), _UNDER).any())


def in_tissue(params: StitchParams, points: Vector, depth: float = 0.0) -> NDArray[np.bool_]:
    """Return whether points of the world, shape (..., 3), are in the pad and deeper than `depth` (m)."""
    pad, (*sides, thickness) = params.phantom.pose, params.phantom.measures.skin
    off = points - pad[:3, 3]
    height, beside = off @ pad[:3, 2], np.abs(off @ pad[:3, :2]) - np.array(sides) / 2.0
    inside: NDArray[np.bool_] = (-thickness < height) & (height < -depth) & (beside < 0.0).all(axis=-1)
    return inside


def _wire_points(params: StitchParams, needle: Vector) -> Vector:
    """Return points of the needle in the world, shape (n, 3), m."""
    shape = params.needle[1].shape
    wire = shape.points(np.linspace(-shape.arc / 2.0, shape.arc / 2.0, 60))
    points: Vector = wire @ needle[:3, :3].T + needle[:3, 3]
    return points


def raise_needle(params: StitchParams, needle: Vector) -> Vector:
    """Return a pose of shape (4, 4), if need be raised until all of the needle is over the skin."""
    pad, up = params.phantom.pose, needle.copy()
    lowest = float(((_wire_points(params, needle) - pad[:3, 3]) @ pad[:3, 2]).min())
    up[:3, 3] += max(0.0, params.lift - lowest) * pad[:3, 2]
    return up


def way_on(
    params: StitchParams, driver: RobotHand, puller: RobotHand, stitch: Stitch, needle: Vector, holder: float
) -> WayOn:
    """Plan `stitch` from the needle's pose, shape (4, 4), in the jaw of arm number `holder` (0: none).

    Raises MotionError, with the number that fails, if there is no way.
    """
    holding = {driver.number: driver, puller.number: puller}.get(holder)
    if holder and holding is None:
        raise MotionError(f"PSM{holder:.0f} holds the needle, which is neither {driver.arm} nor {puller.arm}")
    inside, angle = is_inside(params, needle), stitch.angle(needle)
    if inside:
        angle = _on_its_way(stitch, needle, angle)
        if holding is None:
            return _taken_again(params, driver, puller, stitch, needle, angle)
    up = raise_needle(params, needle)
    over = stitch.entry - BEFORE
    emerge, lift = params.emerge, params.lift
    pull = pulling_poses(stitch, emerge, lift)
    if inside and holding is not None and _can_pull(params, holding, driver, puller, stitch, needle):
        grip, margin = _kept_hold(puller, needle, [pulling_poses(stitch, emerge, lift, angle)])
        return WayOn(StitchPhase.PULL, puller, stitch.pose(angle), angle, np.eye(4), grip, margin)
    taking, pull_margin = _from_a_side(puller, params.taken, stitch, [pull])
    if holding is driver:
        grip = present_grip(driver, needle)
        require_room(behind_tip(grip, driver, stitch), stitch, emerge)
        drive = driving_poses(stitch, emerge, lift, angle if inside else None)
        grip, margin = _kept_hold(driver, needle, [drive] if inside else [[up], drive])
        if not inside:
            return WayOn(StitchPhase.LIFT, driver, up, over, grip, taking, min(margin, pull_margin))
        phase = StitchPhase.DRIVE if angle < stitch.exit + emerge else StitchPhase.COME
        return WayOn(phase, driver, stitch.pose(angle), angle, grip, taking, min(margin, pull_margin))
    require_room(params.grip, stitch, emerge)
    drive = driving_poses(stitch, emerge, lift)
    if holding is puller:
        shown = stitch.pose(stitch.exit + emerge, lift)
        _, kept = _kept_hold(puller, needle, [[shown]])
        grip, margin = _from_a_side(driver, params.grip, stitch, [[shown], drive])
        return WayOn(StitchPhase.PRESENT, puller, shown, over, grip, taking, min(kept, margin, pull_margin))
    wrong_way_up = bool(needle[:3, 2] @ params.phantom.pose[:3, 2] > 0.0)
    grips = grips_of(driver, params.grip, stitch.needle, backwards=wrong_way_up)
    grip, margin = _choose_hold(driver, grips, [[up, needle], drive])
    return WayOn(StitchPhase.HOVER, None, needle, over, grip, taking, min(margin, pull_margin))


def _can_pull(
    params: StitchParams,
    holding: RobotHand,
    driver: RobotHand,
    puller: RobotHand,
    stitch: Stitch,
    needle: Vector,
) -> bool:
    """Return whether a hand holds a needle in the tissue for pulling."""
    if driver is puller:
        behind = behind_tip(present_grip(holding, needle), holding, stitch)
        return behind < (params.grip + params.taken) / 2.0
    return holding is puller


def _taken_again(
    params: StitchParams, driver: RobotHand, puller: RobotHand, stitch: Stitch, needle: Vector, angle: float
) -> WayOn:
    """Plan how a needle held by the tissue alone, the tip at `angle` (rad), is taken hold of."""
    emerge, lift = params.emerge, params.lift
    if angle > stitch.exit + emerge - _NEARLY:
        grip, margin = _from_a_side(
            puller, params.taken, stitch, [pulling_poses(stitch, emerge, lift, angle)]
        )
        return WayOn(StitchPhase.COME, None, needle, angle, np.eye(4), grip, margin)
    require_room(params.grip, stitch, emerge)
    taking, pull_margin = _from_a_side(puller, params.taken, stitch, [pulling_poses(stitch, emerge, lift)])
    grip, margin = _from_a_side(driver, params.grip, stitch, [driving_poses(stitch, emerge, lift, angle)])
    margin = min(margin, pull_margin)
    return WayOn(StitchPhase.HOVER, None, needle, angle, grip, taking, margin, StitchPhase.ALIGN)


def _on_its_way(stitch: Stitch, needle: Vector, angle: float) -> float:
    """Return the angle of a needle in the tissue, on from the entry.

    Raises MotionError for a needle beside its way.
    """
    wanted, marks = stitch.pose(angle), stitch.needle.marks
    off = marks @ (needle[:3, :3] - wanted[:3, :3]).T + needle[:3, 3] - wanted[:3, 3]
    beside = float(np.sqrt((off * off).sum(axis=1).max()))
    if beside > _BESIDE:
        raise MotionError(
            f"the needle is in the tissue and {beside * 1e3:.1f} mm beside its way, allowed are"
            f" {_BESIDE * 1e3:.0f}; lead it back, or pull it out"
        )
    return angle + 2.0 * pi if angle < stitch.entry - BEFORE else angle


def present_grip(hand: RobotHand, needle: Vector) -> Vector:
    """Return the measured pose of a hand's tip in the frame of the needle, both of shape (4, 4)."""
    return inverse_transform(needle) @ pose_to_matrix(hand.measured)


def behind_tip(grip: Vector, hand: RobotHand, stitch: Stitch) -> float:
    """Return how far behind the needle's tip (rad) a jaw holds; `grip`: jaw's tip in the needle's frame."""
    x, y, _ = (grip[:3, 3] + (hand.jaw.length - DEEP) * grip[:3, 2]).tolist()
    return stitch.needle.arc / 2.0 - atan2(y, x)


def _from_a_side(
    hand: RobotHand, behind: float, stitch: Stitch, ways: list[list[Vector]]
) -> tuple[Vector, float]:
    """Return how a hand takes the needle `behind` its tip (rad): from the second side if necessary."""
    side, other = (
        best_grip(hand, grips_of(hand, behind, stitch.needle, backwards=each), ways) for each in (False, True)
    )
    return _feasible(hand, other if side[1].failure_reason and not other[1].failure_reason else side)


def _kept_hold(hand: RobotHand, needle: Vector, ways: list[list[Vector]]) -> tuple[Vector, float]:
    """Return the hand's present hold of the needle, and the margin with this hold."""
    return _choose_hold(hand, [present_grip(hand, needle)], ways)


def _choose_hold(hand: RobotHand, grips: list[Vector], ways: list[list[Vector]]) -> tuple[Vector, float]:
    return _feasible(hand, best_grip(hand, grips, ways))


def _feasible(hand: RobotHand, found: tuple[Vector, ArmReach, int]) -> tuple[Vector, float]:
    grip, worst, _ = found
    if problem := worst.failure_reason:
        raise MotionError(f"the stitch is not feasible: of {hand.arm}, {problem}")
    return grip, worst.margin
