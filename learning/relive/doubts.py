"""Other readings of set-points: what a wrong unit or order of quaternions would mean at the tip."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from learning.relive.arms import PlacedArm, angles_between
from learning.relive.convention import Convention
from schemas.errors import RecordingError
from schemas.vectors import Vector

__all__ = ["Reading", "readings"]

_EVERY = 40
"""Most frames that a reading is tried on."""
_FINGER = 10e-3
"""Length of a finger beyond the tip's frame that a wrong orientation moves, m."""


@dataclass(frozen=True)
class Reading:
    """Set-points in one reading, beside the stated one."""

    convention: Convention
    reach: float
    """Share of the frames in reach, of the arm that reaches least."""
    off_m: float
    """Median distance of the tip from the stated reading."""
    turn_rad: float
    """Median angle from the stated reading."""

    def __str__(self) -> str:
        finger = 2.0 * np.sin(0.5 * self.turn_rad) * _FINGER
        return (
            f"quaternion {self.convention.order}, {self.convention.unit}: {100.0 * self.reach:.0f} % of the"
            f" frames in reach; the tip {1e3 * self.off_m:.3g} mm and {np.degrees(self.turn_rad):.3g} degrees"
            f" away (a finger of {1e3 * _FINGER:.0f} mm ends {1e3 * finger:.3g} mm away)"
        )


def readings(rows: Vector, stated: Convention, arms: Mapping[str, PlacedArm]) -> Iterator[Reading]:
    """Yield all readings by order and unit, the stated one first."""
    some = rows[:: max(1, len(rows) // _EVERY)]
    ours = stated.set_points(some)
    others = [replace(stated, order=order, unit=unit) for order in ("xyzw", "wxyz") for unit in ("m", "mm")]
    for convention in (stated, *(one for one in others if one != stated)):
        try:
            theirs = convention.set_points(some)
        except RecordingError:
            continue
        off = [np.linalg.norm(theirs[arm][:, :3] - ours[arm][:, :3], axis=1) for arm in arms]
        turn = [angles_between(theirs[arm][:, 3:7], ours[arm][:, 3:7]) for arm in arms]
        reach = min(placed.way(theirs[arm]).share for arm, placed in arms.items())
        yield Reading(convention, reach, float(np.median(off)), float(np.median(turn)))
