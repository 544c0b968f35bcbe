"""Types of scenario parameters that speak of arms."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, WithJsonSchema

from robots.dvrk import setup_joints
from robots.dvrk.instruments import Jaw, instrument
from robots.serial_chain import SerialChain
from schemas.errors import MotionError
from schemas.quantity import Angle, Length

__all__ = ["ArmName", "EcmPositions", "InstrumentName", "PsmPositions", "SetupPositions", "UnitQuaternion", "check_start", "settable"]

ArmName = Literal["PSM1", "PSM2", "PSM3"]


def _unit(value: tuple[float, ...]) -> tuple[float, ...]:
    norm = float(np.linalg.norm(value))
    if abs(norm - 1.0) > 1e-6:
        raise ValueError(f"{value} is no unit quaternion (x, y, z, w): its norm is {norm:.6g}")
    return value


def _with_three_wrist_joints(name: str) -> str:
    try:
        found = instrument(name)
    except MotionError as error:
        raise ValueError(str(error)) from error
    if found.has_snake_wrist:
        raise ValueError(f"'{name}' has a snake wrist, which neither model nor motion controller can bend; take an 8 mm instrument such as 400006")
    return found.name


def _text(name: Any) -> Any:
    return str(name) if isinstance(name, int) and not isinstance(name, bool) else name


InstrumentName = Annotated[
    str,
    BeforeValidator(_text),  # a number in YAML needs no quotes
    AfterValidator(_with_three_wrist_joints),
    WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "integer"}], "examples": ["LARGE_NEEDLE_DRIVER_400006", 400006]}),
]
"""Name or number of an instrument that can be mounted on a PSM; the name, once it is validated."""

PsmPositions = tuple[Angle, Angle, Length, Angle, Angle, Angle]
"""Positions of a PSM's six joints (rad, m)."""

EcmPositions = tuple[Angle, Angle, Length, Angle]
"""Positions of the ECM's four joints (rad, m)."""

SetupPositions = tuple[Length, Angle, Angle, Angle, Angle, Angle]
"""Of the setup joints that carry one arm: the lift (m), then five angles."""

UnitQuaternion = Annotated[tuple[float, float, float, float], AfterValidator(_unit)]
"""A rotation as quaternion (x, y, z, w)."""


def check_start(chain: SerialChain, start: Sequence[float], jaw: Jaw | None = None, opening: float = 0.0) -> None:
    """Raise ValueError, as pydantic's validators do, if `start` or the `opening` of the jaw (rad) is not inside its range."""
    try:
        chain.check(np.array(start, np.float64))
    except MotionError as error:
        raise ValueError(str(error)) from error
    if jaw is None and opening:
        raise ValueError(f"jaw at {opening:g} rad, but what the arm holds has no jaw; leave it out")
    if jaw is not None and not jaw.lower <= opening <= jaw.upper:
        raise ValueError(f"jaw at {opening:g} rad, allowed are {jaw.lower:g} .. {jaw.upper:g}")


def settable(arm: setup_joints.CartArm) -> AfterValidator:
    """Return what refuses `SetupPositions` that the setup joint which carries `arm` does not reach."""

    def check(positions: tuple[float, ...]) -> tuple[float, ...]:
        try:
            setup_joints.chain(arm).check(np.array(positions, np.float64))
        except MotionError as error:
            raise ValueError(str(error)) from error
        return positions

    return AfterValidator(check)
