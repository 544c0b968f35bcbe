"""How wrong a needle tracker is, and how wrong it says it is; for simulated needles, whose pose is known."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from controllers.motion.frames import base_in_world
from controllers.needle_tracker.params import HeldNeedleParams
from controllers.needle_tracker.pose import pose_error
from hub.participant import (
    Controller,
    Inputs,
    Outputs,
    Params,
    Record,
    Setup,
    Value,
    array,
    signal_in,
    signal_out,
)
from robots.dvrk import crtk
from robots.training.needles import NEEDLES
from robots.transform import pose_to_matrix
from schemas.ports import Port
from schemas.ros import Float64Message, PoseStamped
from schemas.vectors import Vector

__all__ = ["TrackingError", "TrackingErrorParams"]

_NUMBERS = {
    "position_error": ("m", "distance of the estimated centre from the true one"),
    "normal_error": ("rad", "angle between the estimated normal and the true one"),
    "axis_error": ("rad", "turn about the needle's axis from the true one"),
    "marks_error": ("m", "sum of the distances of base, middle and tip: E of the SRC's first challenge"),
    "nees": ("", "squared error in the estimate's own covariance; 6 on average for a consistent one"),
}


class TrackingErrorParams(HeldNeedleParams):
    """Which arm holds which needle, and where the arm stands."""


class TrackingErrorState(Record):
    """The outputs."""

    error = array(6)
    deviation = array(6)
    figures = array(5)


class TrackingError(Controller):
    """Compares an estimate with the truth of the same instant; it moves nothing."""

    params_model: ClassVar[type[Params]] = TrackingErrorParams
    params: TrackingErrorParams

    def __init__(self, name: str, params: TrackingErrorParams) -> None:
        super().__init__(name, params)
        self._base = base_in_world(params.arm, params)
        self._marks = NEEDLES[params.needle].marks
        self._now = TrackingErrorState()
        self.keep(self._now)
        self._values: dict[str, Value] = {
            "pose_error": self._now.error,
            "pose_deviation": self._now.deviation,
            **{name: self._now.figures[i : i + 1] for i, name in enumerate(_NUMBERS)},
        }

    @property
    def ports(self) -> tuple[Port, ...]:
        """The true pose, the estimate and its covariance in; the errors out."""
        base = crtk.base_frame(self.params.arm)
        return (
            signal_in("truth", PoseStamped, frame="world"),
            signal_in("estimate", PoseStamped, frame=base),
            signal_in("covariance", size=36, shape=(6, 6)),
            signal_out("pose_error", description="m, rad; along the axes of the estimated frame", size=6),
            signal_out("pose_deviation", description="standard deviations of the same", size=6),
            *(
                signal_out(name, Float64Message, meaning, unit=unit)
                for name, (unit, meaning) in _NUMBERS.items()
            ),
        )

    def configure(self, setup: Setup) -> Outputs:  # noqa: ARG002
        """Start with zeros."""
        return self._values

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:  # noqa: ARG002
        """Compare the newest values."""
        truth, estimate = pose_to_matrix(inputs["truth"]), self._base @ pose_to_matrix(inputs["estimate"])
        covariance = inputs["covariance"].reshape(6, 6)
        now = self._now
        now.error[:] = pose_error(estimate, truth)
        now.deviation[:] = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        now.figures[:] = (
            np.linalg.norm(now.error[:3]),
            np.arccos(np.clip(estimate[:3, 2] @ truth[:3, 2], -1.0, 1.0)),
            abs(now.error[5]),
            self._pose_distances(truth, estimate),
            now.error @ np.linalg.lstsq(covariance, now.error, rcond=None)[0],
        )
        return self._values

    def _pose_distances(self, truth: Vector, estimate: Vector) -> float:
        between = self._marks @ (truth - estimate)[:3, :3].T + (truth - estimate)[:3, 3]
        return float(np.linalg.norm(between, axis=1).sum())
