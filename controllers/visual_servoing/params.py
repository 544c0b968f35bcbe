"""Parameters of visual servoing. SI units, radians."""

from __future__ import annotations

from typing import ClassVar, Self

import numpy as np
from pydantic import Field, model_validator

from controllers.visual_servoing.law import Law
from hub.participant import Params
from robots.dvrk import ecm
from robots.dvrk.endoscope import BASELINE
from robots.dvrk.parameters import EcmPositions, check_start
from robots.training import targets
from schemas.quantity import Duration, Length

__all__ = ["ServoingParams"]

_Feature = tuple[float, float]
_Point = tuple[Length, Length]


class ServoingParams(Params):
    """What the target looks like, where it should be seen, and how the endoscope moves there."""

    open_to_pages: ClassVar[bool] = True

    endoscope: ecm.Endoscope = Field(default="straight", description="as the ECM has it")
    baseline: Length = Field(
        default=BASELINE, ge=0.0, description="distance of the two cameras; the left one sees"
    )
    start: EcmPositions = Field(
        default=ecm.HOME, description=f"the command until measured_js is there: {', '.join(ecm.JOINT_NAMES)}"
    )
    points: tuple[_Point, _Point, _Point, _Point] = Field(
        default=targets.DISCS,
        description="centres of the discs, along their outline; seen from the front, x to the right, y down",
    )
    radius: Length = Field(default=targets.DISC_RADIUS, gt=0.0, description="of the discs")
    goal: tuple[_Feature, _Feature, _Feature, _Feature] = Field(
        default=targets.GOAL,
        description=(
            "where the discs should be, in their order: normalised coordinates of the picture (x right, y"
            " down, at depth 1); also an input, to be changed while it runs"
        ),
    )
    law: Law = Field(
        default="direct",
        description=(
            "direct: joint velocities from the features, within all limits; twist: the classical law, by way"
            " of a twist of the camera"
        ),
    )
    gain: float = Field(
        default=2.0, gt=0.0, le=5.0, description="1/s: the share of the error that is taken away in a second"
    )
    tolerance: float = Field(
        default=1.0, gt=0.0, description="px: a goal is reached when no disc is farther from its place"
    )
    margin: float = Field(
        default=8.0, ge=6.0, description="px: discs are kept so far from the edges of the picture"
    )
    max_age: Duration = Field(
        default=200_000_000, gt=0, description="the endoscope holds when the newest picture is older"
    )

    @model_validator(mode="after")
    def _fits(self) -> Self:
        check_start(ecm.chain(), self.start)
        for name, corners in (("points", np.array(self.points)), ("goal", np.array(self.goal))):
            if not np.isfinite(corners).all() or abs(_signed_area(corners)) < 1e-9:
                raise ValueError(f"{name}: {corners.tolist()} do not make a quadrangle")
        return self


def _signed_area(corners: np.ndarray) -> float:
    """Return the area of a quadrangle, corners of shape (4, 2), with its sense of rotation as sign."""
    x, y = (corners - np.roll(corners, -1, axis=0)).T
    u, v = (corners + np.roll(corners, -1, axis=0)).T
    return 0.25 * float((u * y - v * x).sum())
