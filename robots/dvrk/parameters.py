"""Types of scenario parameters that speak of arms."""

from __future__ import annotations

from typing import Annotated, Any, Literal, cast

import numpy as np
from pydantic import AfterValidator

from robots.dvrk import psm
from robots.dvrk.instruments import instrument
from schemas.errors import MotionError
from schemas.quantity import Angle, Length

__all__ = ["ArmName", "HandPositions", "MountedPositions", "PsmPositions", "UnitQuaternion", "home"]

ArmName = Literal["PSM1", "PSM2", "PSM3"]


def _in_range(value: tuple[float, ...]) -> tuple[float, ...]:
    for joint, q in zip(psm.ARM_JOINTS + instrument("palpation-probe").joints, value, strict=True):
        if not joint.lower <= q <= joint.upper:
            raise ValueError(f"{joint.name} {q:g} is out of its range {joint.lower:g} .. {joint.upper:g}")
    return value


def _unit(value: tuple[float, ...]) -> tuple[float, ...]:
    norm = float(np.linalg.norm(value))
    if abs(norm - 1.0) > 1e-6:
        raise ValueError(f"{value} is no unit quaternion (x, y, z, w): its norm is {norm:.6g}")
    return value


PsmPositions = Annotated[tuple[Angle, Angle, Length, Angle, Angle, Angle], AfterValidator(_in_range)]
"""Positions of a PSM's six joints (rad, m), inside their ranges."""

MountedPositions = tuple[Angle, Angle, Length, Angle] | tuple[Angle, Angle, Length, Angle, Angle, Angle]
"""Positions of a PSM's joints (rad, m), as many as it has with its instrument: four with a hand, else six."""

UnitQuaternion = Annotated[tuple[float, float, float, float], AfterValidator(_unit)]
"""A rotation as quaternion (x, y, z, w)."""

HandPositions = tuple[Angle, Angle, Angle, Angle, Angle, Angle]
"""Closings, then spreads, of three fingers."""


def home(arm: dict[str, Any]) -> MountedPositions:
    """Return `psm.home` for the `instrument` of an arm whose fields are being validated; any where that is none."""
    try:
        return cast("MountedPositions", psm.home(instrument(arm.get("instrument", ""))))
    except MotionError:
        return psm.HOME  # not looked at: the instrument has been refused
