"""Conventions of laboratories: which numbers of a data set are the set-points of which arm.

Read from open-h-embodiment/data-collection at 6af6fab. Positions are in metres, jaws in radians.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from robots.dvrk.crtk import CAMERA_FRAME
from schemas.errors import RecordingError
from schemas.vectors import Vector

__all__ = ["CONVENTIONS", "Convention", "Order", "Unit"]

Order = Literal["xyzw", "wxyz"]
Unit = Literal["m", "mm"]
_NUMBERS = 8
"""Numbers of an arm: position, quaternion, jaw."""
_UNIT_NORM = 0.05
"""Largest deviation of a quaternion's norm from 1."""


@dataclass(frozen=True)
class Convention:
    """How a laboratory writes set-points."""

    key: str = "action"
    """Column with the set-points."""
    arms: tuple[str, ...] = ("PSM1", "PSM2")
    """Arms in the order of a row, eight numbers each."""
    order: Order = "xyzw"
    """Order of a quaternion."""
    unit: Unit = "m"
    """Unit of positions."""
    frame: str = CAMERA_FRAME
    """Reference frame of poses: `ECM`, `world` or `base`."""

    def set_points(self, rows: Vector) -> Mapping[str, Vector]:
        """Return poses and jaw of each arm, shape (n, 8): m, quaternion (x, y, z, w), rad.

        Raises RecordingError for rows of another width, or quaternions that are none.
        """
        if rows.ndim != 2 or rows.shape[1] != _NUMBERS * len(self.arms):
            raise RecordingError(
                f"'{self.key}' has {rows.shape[-1]} numbers in a row; {' and '.join(self.arms)} have"
                f" {_NUMBERS} each: position, quaternion, jaw"
            )
        found: dict[str, Vector] = {}
        for i, arm in enumerate(self.arms):
            own = rows[:, i * _NUMBERS : (i + 1) * _NUMBERS].astype(np.float64)
            norms = np.linalg.norm(own[:, 3:7], axis=1)
            if not np.isfinite(own).all() or np.abs(norms - 1.0).max(initial=0.0) > _UNIT_NORM:
                worst = int(np.nanargmax(np.abs(norms - 1.0)))
                raise RecordingError(
                    f"{arm}, frame {worst}: the quaternion has norm {norms[worst]:.3g}, expected 1: numbers 4"
                    " to 7 of an arm are no quaternion; angles, or another layout, are not read"
                )
            own[:, 3:7] /= norms[:, None]
            if self.order == "wxyz":
                own[:, 3:7] = own[:, [4, 5, 6, 3]]
            if self.unit == "mm":
                own[:, :3] *= 1e-3
            found[arm] = own
        return found


CONVENTIONS: Mapping[str, Convention] = {
    "jhu": Convention(),
    "hamlyn": Convention("action.cartesian_absolute", ("PSM2", "PSM1"), "wxyz"),
}
"""Conventions by laboratory; SutureBot is of JHU."""
