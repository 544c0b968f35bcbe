"""Types of scenario parameters that speak of arms."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal, cast

import numpy as np
from pydantic import AfterValidator, BeforeValidator, WithJsonSchema

from robots.dvrk import psm, setup_joints
from robots.dvrk.instruments import Instrument, instrument
from robots.limits import ANGLE_TOLERANCE, distinct
from robots.serial_chain import SerialChain
from schemas.errors import MotionError
from schemas.quantity import Angle, Length

__all__ = [
    "ArmName",
    "EcmPositions",
    "HandPositions",
    "InstrumentName",
    "MountedPositions",
    "SetupPositions",
    "UnitQuaternion",
    "check_start",
    "home",
    "settable",
]

ArmName = Literal["PSM1", "PSM2", "PSM3"]


def _unit(value: tuple[float, ...]) -> tuple[float, ...]:
    norm = float(np.linalg.norm(value))
    if abs(norm - 1.0) > 1e-6:
        raise ValueError(f"{value} is no unit quaternion (x, y, z, w): its norm is {distinct(norm, 1.0)[0]}")
    return value


def _mountable(name: str) -> str:
    try:
        found = instrument(name)
    except MotionError as error:
        raise ValueError(str(error)) from error
    if found.has_snake_wrist:
        raise ValueError(
            f"'{name}' has a snake wrist, which neither model nor motion controller can bend; take an 8 mm"
            " instrument such as 400006"
        )
    return found.name


def _text(name: Any) -> Any:
    return str(name) if isinstance(name, int) and not isinstance(name, bool) else name


InstrumentName = Annotated[
    str,
    BeforeValidator(_text),  # a number in YAML needs no quotes
    AfterValidator(_mountable),
    WithJsonSchema(
        {
            "anyOf": [{"type": "string"}, {"type": "integer"}],
            "examples": ["LARGE_NEEDLE_DRIVER_400006", 400006],
        }
    ),
]
"""Name or number of an instrument that can be mounted on a PSM; the name, once it is validated."""

EcmPositions = tuple[Angle, Angle, Length, Angle]
"""Positions of the ECM's four joints (rad, m)."""

SetupPositions = tuple[Length, Angle, Angle, Angle, Angle, Angle]
"""Of the setup joints that carry one arm: the lift (m), then five angles."""

MountedPositions = tuple[Angle, Angle, Length, Angle] | tuple[Angle, Angle, Length, Angle, Angle, Angle]
"""Positions of a PSM's joints (rad, m), as many as it has with its instrument: four with a hand, else six."""

UnitQuaternion = Annotated[tuple[float, float, float, float], AfterValidator(_unit)]
"""A rotation as quaternion (x, y, z, w)."""

HandPositions = tuple[Angle, Angle, Angle, Angle, Angle, Angle]
"""Closings, then spreads, of three fingers."""
FOLDED: HandPositions = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def home(arm: dict[str, Any]) -> MountedPositions:
    """Return `psm.home` for the `instrument` of an arm whose fields are being validated."""
    try:
        return cast("MountedPositions", psm.home(instrument(arm.get("instrument", ""))))
    except MotionError:
        return psm.HOME  # unused: the instrument is refused


def check_start(
    chain: SerialChain,
    start: Sequence[float],
    tool: Instrument | None = None,
    jaw: float = 0.0,
    hand: Sequence[float] = (),
) -> None:
    """Raise ValueError, as pydantic's validators do, for what is outside its range.

    Args:
        chain: the arm's kinematics.
        start: its joint positions, shape (n,).
        tool: what it holds.
        jaw: opening of the tool's jaw, rad.
        hand: closings, then spreads, of the tool's fingers, rad.
    """
    try:
        chain.check(np.array(start, np.float64))
    except MotionError as error:
        raise ValueError(str(error)) from error
    range_ = tool.jaw if tool is not None else None
    if range_ is None and jaw:
        raise ValueError(f"jaw at {jaw:g} rad, but what the arm holds has no jaw; leave it out")
    if range_ is not None and not _inside(jaw, range_.lower, range_.upper):
        value, lower, upper = distinct(jaw, range_.lower, range_.upper)
        raise ValueError(f"jaw at {value} rad, allowed are {lower} .. {upper}")
    joints = tool.hand.joints if tool is not None and tool.hand is not None else ()
    if not joints and any(hand):
        raise ValueError("closings of a hand, but what the arm holds is none; leave them out")
    for joint, closing in zip(joints, hand, strict=bool(joints)):
        if not _inside(closing, joint.lower, joint.upper):
            raise ValueError(joint.refusal(closing))


def _inside(angle: float, lower: float, upper: float) -> bool:
    return lower - ANGLE_TOLERANCE <= angle <= upper + ANGLE_TOLERANCE


def settable(arm: setup_joints.CartArm) -> AfterValidator:
    """Return a validator of `SetupPositions` that the setup joint of `arm` can reach."""

    def check(positions: tuple[float, ...]) -> tuple[float, ...]:
        try:
            return tuple(setup_joints.chain(arm).within(np.array(positions, np.float64)).tolist())
        except MotionError as error:
            raise ValueError(str(error)) from error

    return AfterValidator(check)
