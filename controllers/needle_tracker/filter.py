"""An error-state extended Kalman filter of the needle's pose in the gripper; numpy alone.

A needle held moves with the gripper, so what is estimated is its pose in the gripper's frame. The
prediction of its pose in the camera's frame then is the kinematics of both arms, without integrating anything
(the gripper's twist moves the mean exactly), and what is left to be estimated hardly changes: it drifts by
what the kinematics do not know, and jumps when the needle slips.

The mean is a pose, the error six numbers in the needle's own frame (`pose`). The update is iterated to the
maximum a posteriori (Bell and Cathey, The iterated Kalman filter update as a Gauss-Newton method, IEEE
Transactions on Automatic Control 38(2), 1993).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from controllers.needle_tracker.arc_fit import Arc, ArcFit, Detection, fit_arc
from controllers.needle_tracker.noise import Noise
from controllers.needle_tracker.pose import move_pose, pose_error
from schemas.vectors import Vector

__all__ = ["Estimate", "NeedleView", "Update", "predict_estimate", "update_estimate"]

_ITERATIONS = 6
_DONE = 1e-6
"""m and rad: a smaller step ends the iteration."""
_SEARCHING, _NARROWING = 8, 0.35
"""Iterations of a search, and by how much each narrows the covariance that its gate is made of."""
_HUBER = 3.0
"""Residuals above as many standard deviations count less (Huber, Robust Statistics, 1981)."""


@dataclass(frozen=True)
class Estimate:
    """The needle's pose in the gripper's frame, (4, 4), and the covariance of its error, (6, 6): m, rad."""

    pose: Vector
    covariance: Vector


@dataclass(frozen=True)
class NeedleView:
    """What one eye sees, and from where."""

    projection: Vector
    """Projection from the gripper's frame to pixels, shape (3, 4)."""
    seen: Detection


@dataclass(frozen=True)
class Update:
    """The estimate after a picture, and how well the picture fits."""

    estimate: Estimate
    misfit: float
    """Mean squared residual after the update, in variances."""
    departure: float
    """Squared distance of the estimate from the prior, in the prior's covariance."""
    innovation: float
    """Mean squared innovation before the update, in variances: 1 where all is as the filter believes."""
    explained: float
    """Share of the wire seen where it should be, the mean of the eyes that see any."""
    unexplained: float
    """Length of what has the wire's colour elsewhere, as a share of the wire's."""
    tip: bool
    """Whether an eye saw the tip where it should be."""
    tip_refused: bool
    """Whether eyes saw a tip elsewhere only."""


def predict_estimate(estimate: Estimate, seconds: float, drift: tuple[float, float]) -> Estimate:
    """Return the estimate after a time in which the needle may have drifted in the gripper.

    `drift`: standard deviations after a second, m and rad; they grow with the square root of the time.
    """
    grown = np.repeat(np.square(drift), 3) * seconds
    return Estimate(estimate.pose, estimate.covariance + np.diag(grown))


def update_estimate(
    arc: Arc,
    prior: Estimate,
    views: Sequence[NeedleView],
    noise: Noise,
    gate: float,
    start: Vector | None = None,
) -> Update:
    """Return the estimate that is likeliest after what `views` show.

    Args:
        arc: the needle.
        prior: what is known before.
        views: of one or two eyes.
        noise: of what they see.
        gate: standard deviations of the prior up to which something seen is taken for the needle.
        start: the pose from which to search, shape (4, 4): the gate then narrows from iteration to iteration;
            default: the prior's, with a gate that stays.
    """
    information = np.linalg.inv(prior.covariance)
    pose, spread = prior.pose if start is None else start, prior.covariance
    first: list[ArcFit] = []
    fits: list[ArcFit] = []
    posterior = spread
    tip_first = start is not None
    for _ in range(_ITERATIONS if start is None else _SEARCHING):
        fits = [fit_arc(arc, view.projection, pose, view.seen, noise, spread, gate) for view in views]
        first = first or fits
        tip_first = tip_first and any(each.tip for each in fits)
        residuals, slopes, spreads = _stack_fits([each.tip_only for each in fits] if tip_first else fits)
        weights = np.sqrt(_robust_weights(residuals, spreads))
        weighted = np.linalg.solve(spreads, weights[:, None] * slopes) * weights[:, None]  # (n, 6)
        off = pose_error(prior.pose, pose)
        normal = information + slopes.T @ weighted
        step = np.linalg.solve(normal, weighted.T @ residuals - information @ off)
        pose = move_pose(pose, cast("Vector", step))
        posterior = cast("Vector", np.linalg.inv(normal))
        if tip_first:
            # no other thing has a tip, so it says first whereabouts the wire is to be looked for
            spread, tip_first = posterior, False
        elif start is not None:
            spread = _NARROWING * spread
        elif abs(step).max() < _DONE:
            break
    return _judge_estimate(Estimate(pose, 0.5 * (posterior + posterior.T)), prior, first, fits)


def _stack_fits(fits: Sequence[ArcFit]) -> tuple[Vector, Vector, Vector]:
    """Return the residuals of all eyes (n,), their slopes (n, 6), and their covariance (n, n)."""
    common = np.vstack([each.common for each in fits])
    spread = np.diag(np.concatenate([each.variances for each in fits])) + common @ common.T
    return (
        np.concatenate([each.residuals for each in fits]),
        np.vstack([each.slopes for each in fits]),
        spread,
    )


def _robust_weights(residuals: Vector, spread: Vector) -> Vector:
    size = np.abs(residuals) / np.sqrt(np.diag(spread))
    return np.minimum(1.0, _HUBER / np.maximum(size, 1e-12))


def _judge_estimate(
    estimate: Estimate, prior: Estimate, first: Sequence[ArcFit], last: Sequence[ArcFit]
) -> Update:
    residuals, _, spread = _stack_fits(last)
    misfit = float((residuals**2 / np.diag(spread)).mean()) if residuals.size else 0.0
    off = pose_error(prior.pose, estimate.pose)
    residuals, slopes, spread = _stack_fits(first)
    innovation = 1.0
    if residuals.size:
        spread = slopes @ prior.covariance @ slopes.T + spread
        innovation = float(residuals @ np.linalg.solve(spread, residuals)) / residuals.size
    seeing = [each for each in last if each.explained > 0.0]
    return Update(
        estimate,
        misfit,
        float(off @ np.linalg.solve(prior.covariance, off)),
        innovation,
        float(np.mean([each.explained / each.expected for each in seeing])) if seeing else 0.0,
        float(np.mean([each.unexplained / each.expected for each in last])) if last else 0.0,
        any(each.tip for each in last),
        any(each.tip_refused for each in last) and not any(each.tip for each in last),
    )
