"""Joint errors: encoders with offsets, as on real arms and in the suturing challenge.

An encoder with offset e measures q - e at a joint position q, and the servo, following the encoder, goes to q
+ e for a command of q. So a controller sees nothing of the offset. SI units, radians.
"""

from __future__ import annotations

from hashlib import blake2b
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field

from hub.participant import Params
from schemas.quantity import Angle, Length
from schemas.vectors import Vector

__all__ = ["JointErrors"]

_Offsets = tuple[Angle, Angle, Length]
"""Offsets of yaw, pitch and insertion."""


def _check_positive(bounds: _Offsets | None) -> _Offsets | None:
    if bounds is not None and min(bounds) < 0.0:
        raise ValueError(f"{bounds}: bounds are not below 0")
    return bounds


class JointErrors(Params):
    """True minus measured yaw, pitch and insertion of an arm.

    The Surgical Robotics Challenge draws these offsets within 5 degrees, 5 degrees and 5 mm.
    """

    PSM1: _Offsets | None = Field(default=None, description="as stated, whatever is drawn")
    PSM2: _Offsets | None = None
    PSM3: _Offsets | None = None
    within: Annotated[_Offsets | None, AfterValidator(_check_positive)] = Field(
        default=None, description="bounds between which those of the other PSMs are drawn; null: 0"
    )
    seed: int = Field(default=0, ge=0, description="draws them, for every arm others")

    def of(self, arm: str, joints: int) -> Vector:
        """Return the offsets of the measured positions of an arm's `joints` joints, shape (joints,)."""
        offsets = np.zeros(joints)
        stated: _Offsets | None = getattr(self, arm, None)
        if stated is not None:
            offsets[:3] = stated
        elif self.within is not None and arm.startswith("PSM"):
            drawn = np.frombuffer(blake2b(f"{self.seed}/{arm}".encode(), digest_size=24).digest(), "<u8")
            offsets[:3] = self.within * (drawn / 2.0**63 - 1.0)
        return offsets
