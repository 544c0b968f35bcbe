"""Types of scenario parameters about arms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import repeat
from types import MappingProxyType
from typing import Annotated, Any, Literal, cast

import numpy as np
from pydantic import AfterValidator, BeforeValidator, WithJsonSchema

from robots.dvrk import psm, setup_joints
from robots.dvrk.end_effectors.end_effector import EndEffector
from robots.dvrk.instruments import instrument
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
    "MtmPositions",
    "SetupPositions",
    "UnitQuaternion",
    "check_start",
    "home",
    "settable",
    "start_positions",
]

ArmName = Literal["PSM1", "PSM2", "PSM3"]


def _check_unit_quaternion(value: tuple[float, ...]) -> tuple[float, ...]:
    norm = float(np.linalg.norm(value))
    if abs(norm - 1.0) > 1e-6:
        raise ValueError(f"{value} is no unit quaternion (x, y, z, w): its norm is {distinct(norm, 1.0)[0]}")
    return value


def _check_mountable(name: str) -> str:
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
    AfterValidator(_check_mountable),
    WithJsonSchema(
        {
            "anyOf": [{"type": "string"}, {"type": "integer"}],
            "examples": ["LARGE_NEEDLE_DRIVER_400006", 400006],
        }
    ),
]
"""Name or number of an instrument for a PSM; after validation the name."""

EcmPositions = tuple[Angle, Angle, Length, Angle]
"""Positions of the ECM's four joints (rad, m)."""

MtmPositions = tuple[Angle, Angle, Angle, Angle, Angle, Angle, Angle]
"""Positions of a master's seven joints (rad)."""

SetupPositions = tuple[Length, Angle, Angle, Angle, Angle, Angle]
"""Positions of the setup joints of an arm: the lift (m), then five angles."""

MountedPositions = tuple[Angle, Angle, Length, Angle] | tuple[Angle, Angle, Length, Angle, Angle, Angle]
"""Positions of a PSM's joints (rad, m): four with a hand, else six."""

UnitQuaternion = Annotated[tuple[float, float, float, float], AfterValidator(_check_unit_quaternion)]
"""A rotation as quaternion (x, y, z, w)."""

HandPositions = tuple[Angle, Angle, Angle, Angle, Angle, Angle]
"""Closings, then spreads, of three fingers."""
FOLDED: HandPositions = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def home(arm: dict[str, Any]) -> MountedPositions:
    """Return `psm.home` for the `instrument` of an arm under validation."""
    try:
        return cast("MountedPositions", psm.home(instrument(arm.get("instrument", ""))))
    except MotionError:
        return psm.HOME  # unused: the instrument is refused


_RIGID = EndEffector()


def check_start(
    chain: SerialChain,
    start: Sequence[float],
    end_effector: EndEffector = _RIGID,
    given: Mapping[str, Sequence[float]] = MappingProxyType({}),
) -> None:
    """Raise ValueError, as pydantic's validators do, for positions out of range.

    Args:
        chain: the arm's kinematics.
        start: joint positions, shape (n,).
        end_effector: end effector of the arm.
        given: positions from the scenario for joints of end effectors, by the effector's name.
    """
    try:
        chain.check(np.array(start, np.float64))
    except MotionError as error:
        raise ValueError(str(error)) from error
    for name, positions in given.items():
        if name != end_effector.name and any(positions):
            values = ", ".join(f"{position:g}" for position in positions)
            raise ValueError(f"{name} at {values} rad, but the arm's instrument has no {name}; leave it out")
    positions = start_positions(end_effector, given)
    for joint, position in zip(end_effector.joints, positions, strict=True):
        if not joint.lower - ANGLE_TOLERANCE <= position <= joint.upper + ANGLE_TOLERANCE:
            raise ValueError(joint.refusal(position))


def start_positions(end_effector: EndEffector, given: Mapping[str, Sequence[float]]) -> tuple[float, ...]:
    """Return the positions of all joints of an end effector at time 0; 0 where the scenario states none."""
    count = len(end_effector.joints)
    return (*given.get(end_effector.name, ()), *repeat(0.0, count))[:count]


def settable(arm: setup_joints.CartArm) -> AfterValidator:
    """Return a validator of `SetupPositions` within reach of the setup joint of `arm`."""

    def check(positions: tuple[float, ...]) -> tuple[float, ...]:
        try:
            return tuple(setup_joints.chain(arm).within(np.array(positions, np.float64)).tolist())
        except MotionError as error:
            raise ValueError(str(error)) from error

    return AfterValidator(check)
