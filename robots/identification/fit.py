"""Physically feasible parameters of an arm from measured efforts.

First weighted least squares over the base parameters: the weight of a joint is the inverse standard deviation
of the residual of an unweighted fit (Swevers et al., IEEE Control Systems 27(5), 2007). The result is the
standard deviations and the condition number. Then the parameters themselves, physically feasible: the
pseudo-inertia of each body is (L M) (L M)^T with L of the published body and M lower triangular with diagonal
exp(x) (Rucker and Wensing, RA-L 2022); friction, springs and rotors are not negative. Unidentifiable
parameters stay near the published values. The sharpness of friction's change of sign is chosen before
(`robots.identification.friction`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from robots.identification.arms import IdentifiedArm
from robots.identification.base_parameters import BaseParameters, base_parameters
from robots.identification.friction import Candidate, choose_shape, columns_of_picks, grid
from robots.identification.linear_model import BODY_SIZE, LinearModel, pseudo_inertias
from robots.identification.signals import Samples
from schemas.errors import RecordingError
from schemas.vectors import Vector

__all__ = ["LARGEST_CONDITION", "Fit", "fit", "relative_residual"]

LARGEST_CONDITION = 1e5
"""Largest condition number of the scaled base regressor; above, the motion excites some base parameters too
little.
"""
_TRAINED = 0.75
"""Fraction of the samples, from the first on, used by the fit; the rest judges the fit."""
_PRIOR = 1e-2
"""Weight of a change of a body by exp(1), or of another parameter by its scale, against a standard deviation
of a measured effort.
"""
_SCALES = {
    "armature": 1e-2,
    "stiffness": 0.1,
    "offset": 0.1,
    "viscous": 0.1,
    "coulomb": 0.1,
    "static": 0.1,
}
"""kg m^2 and kg, N m/rad and N/m, N m and N, N m s/rad and N s/m: the order of the published values."""
_SCALE_OF_DISC = 0.1
"""Scale of the friction of a disc or a pair of fingers, relative to the friction of a joint."""
_LEAST = 1e-6
"""Least friction, springs and rotors."""
_FARTHEST = 5.0
"""Largest |x| in the exp(x) of a body: masses from 1/20000 to 20000 times the published mass."""
_TRIANGLE = np.tril_indices(4)
_DIAGONAL = _TRIANGLE[0] == _TRIANGLE[1]
_UPPER = np.triu_indices(4)


class Fit(NamedTuple):
    """Result of a fit; P parameters of the model, B base parameters, n joints."""

    model: LinearModel
    """Model of the parameters, with the chosen shape of friction."""
    parameters: Vector
    """Feasible, shape (P,)."""
    base: BaseParameters
    base_values: Vector
    """Base parameters by weighted least squares, shape (B,)."""
    base_deviations: Vector
    """Standard deviations of these, shape (B,)."""
    base_shares: Vector
    """Largest contribution of each base parameter to the effort of a joint: root mean square, relative to the
    measured effort, shape (B,).
    """
    condition: float
    """Condition number of the base regressor, columns scaled to length 1."""
    residual: Vector
    """Residual of the feasible parameters on the test samples, as `relative_residual`, shape (n,)."""
    published_residual: Vector
    """Residual of the published parameters on the test samples, shape (n,)."""
    time: Vector
    """Time, s, shape (N,); recordings are concatenated."""
    predicted: Vector
    """Efforts of the feasible parameters, shape (N, n)."""
    published: Vector
    """Efforts of the published parameters, shape (N, n)."""
    measured: Vector
    """Filtered, shape (N, n)."""
    test: slice
    """Test samples, not used by the fit."""


def fit(
    recorded: Sequence[Samples],
    arm: IdentifiedArm,
    *,
    gravity: Vector | None = None,
    stribeck: bool = False,
    judged: Samples | None = None,
) -> Fit:
    """Return the dynamic parameters of an arm with the least error on the samples of all recordings.

    Args:
        recorded: recordings of the joints of `arm`.
        arm: the arm with its instrument.
        gravity: gravity in the arm's base frame, m/s^2, shape (3,); by default for an upright base.
        stribeck: whether dry friction may be larger at rest.
        judged: a recording kept back to judge the result; by default the last quarter of the samples.

    Raises RecordingError if the motion does not excite the arm enough.
    """
    rows = _Rows.of(LinearModel(arm, gravity), [*recorded, *([judged] if judged else [])], stribeck=stribeck)
    unseen = judged.kept_count if judged else round((1.0 - _TRAINED) * len(rows.time))
    trained = len(rows.time) - unseen
    seen, test = slice(None, trained), slice(trained, None)
    published = rows.regressor @ rows.model.nominal + rows.carried
    rows = _with_friction(rows, seen)
    model, regressor, carried, measured = rows.model, rows.regressor, rows.carried, rows.measured
    effort = measured - carried
    base = base_parameters(model)
    condition = _condition(regressor[seen], base)
    sigma = _residual_deviations(regressor[seen][..., base.columns], effort[seen])
    weighted = (regressor[seen] / sigma[:, None]).reshape(-1, regressor.shape[-1])
    goal = (effort[seen] / sigma).ravel()
    base_values, deviations = _least_squares(weighted[:, base.columns], goal)
    parameters = _feasible(model, weighted, goal)
    predicted = regressor @ parameters + carried
    size = np.sqrt(np.mean(measured[seen] ** 2, axis=0))
    acts = np.sqrt(np.mean((regressor[seen][..., base.columns] * base_values) ** 2, axis=0)) / size[:, None]
    return Fit(
        model,
        parameters,
        base,
        base_values,
        deviations * np.sqrt(_samples_per_independent(recorded[0])),
        acts.max(axis=0),
        condition,
        relative_residual(predicted[test], measured[test]),
        relative_residual(published[test], measured[test]),
        rows.time,
        predicted,
        published,
        measured,
        test,
    )


class _Rows(NamedTuple):
    """All recordings, end to end; N samples."""

    model: LinearModel
    time: Vector
    """s, shape (N,)."""
    regressor: Vector
    """Shape (N, n, P)."""
    carried: Vector
    """Efforts of the known parameters, shape (N, n)."""
    measured: Vector
    """Efforts, shape (N, n)."""
    dry: list[Candidate]
    """Shapes of the friction."""

    @classmethod
    def of(cls, model: LinearModel, recorded: Sequence[Samples], *, stribeck: bool) -> _Rows:
        parts: list[tuple[Vector, ...]] = []
        shapes = grid(model, stribeck=stribeck)
        start = 0.0
        for samples in recorded:
            inner = samples.inner
            filtered = map(samples.low_passed, model.regressor(samples.q, samples.dq, samples.ddq))
            regressor, carried = (values[inner] for values in filtered)
            dry = (samples.low_passed(model.dry(samples.dq, shape))[inner] for shape in shapes)
            time = start + samples.time[inner] - samples.time[0]
            parts.append((time, regressor, carried, samples.effort[inner], *dry))
            start += float(samples.time[-1] - samples.time[0])
        columns = zip(*parts, strict=True)
        time, regressor, carried, measured, *dry = (np.concatenate(column) for column in columns)
        return cls(
            model,
            time,
            regressor,
            carried,
            measured,
            [Candidate(*pair) for pair in zip(shapes, dry, strict=True)],
        )


def _with_friction(rows: _Rows, seen: slice) -> _Rows:
    """Return the rows with the shape of friction of least error on the samples of the fit."""
    model, effort = rows.model, rows.measured - rows.carried
    base = base_parameters(model)
    coulomb = model.parts["coulomb"]
    fixed = [column for column in base.columns.tolist() if not coulomb.start <= column < coulomb.stop]
    sigma = _residual_deviations(rows.regressor[seen][..., base.columns], effort[seen])[:, None]
    weighted = [Candidate(one.shape, one.columns[seen] / sigma) for one in rows.dry]
    shape, picks = choose_shape(
        model.shares, rows.regressor[seen][..., fixed] / sigma, weighted, effort[seen] / sigma[:, 0]
    )
    columns = columns_of_picks([one.columns for one in rows.dry], picks)
    regressor = np.concatenate([rows.regressor[..., : coulomb.start], columns], axis=-1)
    return rows._replace(model=LinearModel(model.arm, model.gravity, shape), regressor=regressor)


def _least_squares(rows: Vector, goal: Vector) -> tuple[Vector, Vector]:
    """Return the parameters and their standard deviations, for rows of unit variance."""
    lengths = np.linalg.norm(rows, axis=0)
    _, triangle = np.linalg.qr(rows / lengths)
    values: Vector = np.asarray(np.linalg.lstsq(rows / lengths, goal)[0], np.float64)
    spread = np.linalg.norm(np.linalg.inv(triangle), axis=1)
    return values / lengths, spread / lengths


def relative_residual(predicted: Vector, measured: Vector) -> Vector:
    """Return root mean square error over root mean square measured effort, by joint, shape (n,)."""
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
    """Return the number of samples per independent sample: two are independent in a period of the cut-off."""
    return max(1.0, 1.0 / (2.0 * samples.cutoff * float(samples.time[1] - samples.time[0])))


def _residual_deviations(regressor: Vector, effort: Vector) -> Vector:
    """Return the standard deviation of the residual of unweighted least squares by joint, shape (n,)."""
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
    scales = np.array(
        [
            _SCALES[kind] * (_SCALE_OF_DISC if what.startswith(("disc_", "finger_")) else 1.0)
            for kind, what in (name.split(".") for name in model.names[body.stop :])
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

    upper = np.full(len(model.nominal), np.inf)
    upper[: body.stop] = np.where(np.tile(_DIAGONAL, len(roots)), _FARTHEST, np.inf)
    lower = -upper
    lower[body.stop :] = (_LEAST - nominal) / scales
    offset = model.parts["offset"]
    lower[offset] = -np.inf
    start = np.maximum(np.zeros(len(lower)), lower + 1e-6)
    found = least_squares(residual, start, bounds=(lower, upper), x_scale="jac", max_nfev=60)
    return parameters(found.x)
