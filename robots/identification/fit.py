"""The parameters of an arm that explain its measured efforts and that an arm can have.

First weighted least squares over the base parameters: the weight of a joint is one over the standard
deviation of what an unweighted fit leaves there (Swevers et al., IEEE Control Systems 27(5), 2007). It gives
standard deviations and the condition number. Then the parameters themselves, physically feasible: the
pseudo-inertia of each body is (L M) (L M)^T with L of the published body and M lower triangular with diagonal
exp(x) (Rucker and Wensing, RA-L 2022), friction, springs and rotors are not negative. What the measurements
do not tell stays near the published values.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from robots.dvrk.instruments import Instrument
from robots.identification.base_parameters import BaseParameters, base_parameters
from robots.identification.linear_model import BODY_SIZE, LinearModel, pseudo_inertias
from robots.identification.signals import Samples
from schemas.errors import RecordingError
from schemas.vectors import Vector

__all__ = ["LARGEST_CONDITION", "Fit", "fit", "relative_residual"]

LARGEST_CONDITION = 1e5
"""Of the scaled base regressor; above it the motion excites some base parameters too little to tell them."""
_TRAINED = 0.75
"""Of the samples, the first ones; the rest is not seen by the fit and judges it."""
_PRIOR = 1e-2
"""Weight of a change of a body by exp(1), or of another parameter by its scale, against one standard
deviation of one measured effort."""
_SCALES = {
    "armature": 1e-2,
    "stiffness": 0.1,
    "offset": 0.1,
    "viscous": 0.1,
    "coulomb": 0.1,
    "disc_viscous": 0.01,
    "disc_coulomb": 0.01,
}
"""kg m^2 and kg, N m/rad and N/m, N m and N, N m s/rad and N s/m: the order of the published values."""
_LEAST = 1e-6
"""Of friction, springs and rotors."""
_TRIANGLE = np.tril_indices(4)
_DIAGONAL = _TRIANGLE[0] == _TRIANGLE[1]
_UPPER = np.triu_indices(4)


class Fit(NamedTuple):
    """What was found; P parameters of the model, B base parameters, n joints."""

    parameters: Vector
    """Feasible, shape (P,)."""
    base: BaseParameters
    base_values: Vector
    """By weighted least squares, shape (B,)."""
    base_deviations: Vector
    """Standard deviations of these, shape (B,)."""
    condition: float
    """Of the base regressor, columns scaled to length 1."""
    residual: Vector
    """Of the feasible parameters on the samples not seen, as `relative_residual`, shape (n,)."""
    published_residual: Vector
    """Of the published parameters there, shape (n,)."""
    time: Vector
    """s, shape (N,); recordings follow one another."""
    predicted: Vector
    """Efforts of the feasible parameters, shape (N, n)."""
    measured: Vector
    """Filtered, shape (N, n)."""
    test: slice
    """Which of these were not seen."""


def fit(recorded: Sequence[Samples], tool: Instrument) -> Fit:
    """Return the dynamic parameters of a PSM with `tool` that explain the samples of all recordings.

    Raises RecordingError if the motion does not excite the arm enough to tell them.
    """
    model = LinearModel(tool)
    time, regressor, carried, measured = _stacked(model, recorded)
    effort = measured - carried
    trained = int(_TRAINED * len(measured))
    seen, test = slice(None, trained), slice(trained, None)
    base = base_parameters(model, tool)
    condition = _condition(regressor[seen], base)
    sigma = _noise(regressor[seen][..., base.columns], effort[seen])
    rows = (regressor[seen] / sigma[:, None]).reshape(-1, regressor.shape[-1])
    goal = (effort[seen] / sigma).ravel()
    chosen = rows[:, base.columns]
    base_values: Vector = np.asarray(np.linalg.lstsq(chosen, goal)[0], np.float64)
    deviations = np.sqrt(np.diag(np.linalg.inv(chosen.T @ chosen)) * _samples_per_independent(recorded[0]))
    parameters = _feasible(model, rows, goal)
    predicted = regressor @ parameters + carried
    published = regressor[test] @ model.nominal + carried[test]
    return Fit(
        parameters,
        base,
        base_values,
        deviations,
        condition,
        relative_residual(predicted[test], measured[test]),
        relative_residual(published, measured[test]),
        time,
        predicted,
        measured,
        test,
    )


def _stacked(model: LinearModel, recorded: Sequence[Samples]) -> tuple[Vector, Vector, Vector, Vector]:
    """Return time, regressor, efforts of the instrument and measured efforts of all recordings, end to end.

    The first has shape (N,), the second (N, n, P), the others (N, n).
    """
    parts: list[tuple[Vector, Vector, Vector, Vector]] = []
    start = 0.0
    for samples in recorded:
        state, inner = (samples.q, samples.dq, samples.ddq), samples.inner
        regressor, carried = (samples.low_passed(term(*state)) for term in (model.regressor, model.carried))
        time = start + samples.time[inner] - samples.time[0]
        parts.append((time, regressor[inner], carried[inner], samples.effort[inner]))
        start += float(samples.time[-1] - samples.time[0])
    time, regressor, carried, measured = (np.concatenate(column) for column in zip(*parts, strict=True))
    return time, regressor, carried, measured


def relative_residual(predicted: Vector, measured: Vector) -> Vector:
    """Return the root mean square of the error over that of the measured effort, by joint, shape (n,)."""
    error, scale = (np.sqrt(np.mean(values**2, axis=0)) for values in (predicted - measured, measured))
    return error / np.maximum(scale, np.finfo(float).tiny)


def _condition(regressor: Vector, base: BaseParameters) -> float:
    columns = regressor[..., base.columns].reshape(-1, len(base.columns))
    lengths = np.linalg.norm(columns, axis=0)
    condition = float(np.linalg.cond(columns / lengths)) if lengths.all() else np.inf
    if condition > LARGEST_CONDITION:
        raise RecordingError(
            f"the motion does not excite the arm: condition number {condition:.2g}, allowed up to"
            f" {LARGEST_CONDITION:.2g}. Record all joints moving at once,"
            f" over their range, fast and slow"
        )
    return condition


def _samples_per_independent(samples: Samples) -> float:
    """Return how many samples tell as much as one: what is filtered has two independent ones a period."""
    return max(1.0, 1.0 / (2.0 * samples.cutoff * float(samples.time[1] - samples.time[0])))


def _noise(regressor: Vector, effort: Vector) -> Vector:
    """Return the standard deviation of what unweighted least squares leaves at each joint, shape (n,)."""
    count, n, size = regressor.shape
    found = np.linalg.lstsq(regressor.reshape(-1, size), effort.ravel())[0]
    left = np.sqrt(np.sum((effort - regressor @ found) ** 2, axis=0) / max(1, count - size / n))
    return np.maximum(left, 1e-6 * np.abs(effort).max())


def _feasible(model: LinearModel, rows: Vector, goal: Vector) -> Vector:
    """Return the feasible parameters next to `goal`, shape (P,); `rows` have shape (rows, P)."""
    body = model.parts["body"]
    roots = np.linalg.cholesky(pseudo_inertias(model.nominal[body]))
    # Of as many rows as parameters: the triangle of QR leaves the same sum of squares, but for a constant.
    triangle: Vector = np.asarray(np.linalg.qr(np.column_stack([rows, goal]), mode="r"), np.float64)
    matrix, wanted = triangle[:, :-1], triangle[:, -1]
    nominal = model.nominal[body.stop :]
    scales = np.concatenate(
        [
            np.full(part.stop - part.start, _SCALES[name])
            for name, part in model.parts.items()
            if name != "body"
        ]
    )

    def parameters(x: Vector) -> Vector:
        factors = np.zeros((len(roots), 4, 4))
        shapes = x[: body.stop].reshape(-1, BODY_SIZE)
        factors[:, _TRIANGLE[0], _TRIANGLE[1]] = np.where(_DIAGONAL, np.exp(shapes), shapes)
        factors = roots @ factors
        bodies = factors @ factors.swapaxes(1, 2)
        return np.concatenate([bodies[:, _UPPER[0], _UPPER[1]].ravel(), nominal + scales * x[body.stop :]])

    def residual(x: Vector) -> Vector:
        return np.concatenate([matrix @ parameters(x) - wanted, _PRIOR * x])

    lower = np.full(len(model.nominal), -np.inf)
    lower[body.stop :] = (_LEAST - nominal) / scales
    offset = model.parts["offset"]
    lower[offset] = -np.inf
    start = np.maximum(np.zeros(len(lower)), lower + 1e-6)
    found = least_squares(residual, start, bounds=(lower, np.inf), x_scale="jac", max_nfev=60)
    return parameters(found.x)
