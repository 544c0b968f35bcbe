"""Modulus, stiffening, relaxation and friction from measured depths and forces, with deviations."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import least_squares

from engines.bullet.calibration.indentation import Indenter, elastic_force
from engines.bullet.calibration.measurements import Measured
from engines.bullet.calibration.relaxation import Prony
from schemas.errors import RecordingError
from schemas.vectors import Vector

__all__ = ["Calibration", "calibrate"]

_LARGEST_STIFFENING, _NO_STIFFENING = 200.0, 1e-9
_UNIFORM = float(np.sqrt(12.0))
"""Width over standard deviation of a uniform distribution."""
_STARTS = ((0.02, 0.3), (0.1, 1.0), (0.3, 0.5))
"""Starts of the time constants, as fractions of the measured time: least squares may miss the best minimum.
"""
_MOST_STEPS = 200
_SLIDING = 0.1
"""Fraction of the largest speed along the surface; above, the indenter slides."""
_PRESSING = 0.1
"""Fraction of the largest force; above, the indenter presses."""


@dataclass(frozen=True)
class Calibration:
    """Result of a calibration; `deviations` has the standard deviations under the same names."""

    young_modulus: float
    """Pa, instantaneous."""
    stiffening: float | None
    """Stiffening as in `elastic_force`; None: not fitted."""
    surface: float
    """Depth of first contact, m."""
    relaxation: Prony
    friction: float | None
    """Coulomb's coefficient; None: nothing slid."""
    deviations: dict[str, float]
    predicted: Vector = field(repr=False)
    """Force (N) of these, shape (n,)."""
    residual: float
    """Root mean square of the error over root mean square of the measured force."""


@dataclass(frozen=True)
class _Model:
    """The measured force as a function of parameters.

    Parameters: logarithm of the modulus, depth of the surface over the radius, relaxing share and the quick
    part of the share, logarithms of the quick time constant and of the ratio of slow to quick, and
    stiffening.
    """

    measured: Measured
    indenter: Indenter

    def prony(self, x: Vector) -> Prony:
        share, quick = float(x[2]), float(x[3])
        first, ratio = np.exp(x[4:6]).tolist()
        return Prony((share * quick, share * (1.0 - quick)), (first, first * (1.0 + ratio)))

    def force(self, x: Vector) -> Vector:
        depth = self.measured.depth - x[1] * self.indenter.radius
        elastic = elastic_force(self.indenter, depth, float(np.exp(x[0])), float(x[6]))
        return self.prony(x).relaxed(self.measured.time, elastic)

    def named(self, x: Vector) -> Vector:
        """Return the reported values, in the order of `_NAMES`."""
        found = self.prony(x)
        return np.array([np.exp(x[0]), x[6], x[1] * self.indenter.radius, *found.shares, *found.times])


_NAMES = ("young_modulus", "stiffening", "surface", "share_1", "share_2", "time_1", "time_2")


def calibrate(measured: Measured, indenter: Indenter, *, two_parameters: bool = False) -> Calibration:
    """Return the material with the least error on `measured`.

    Args:
        measured: a press, with a hold for the relaxation; then a slide for friction.
        indenter: indenter and tissue sample.
        two_parameters: fit a stiffening beside the modulus.

    Raises RecordingError if no law holds for the depths, or the force does not grow with depth.
    """
    indenter.check(measured.depth)
    scale = float(np.sqrt(np.mean(measured.force**2)))
    unit = elastic_force(indenter, measured.depth, 1.0, 0.0)
    modulus = float(unit @ measured.force) / float(unit @ unit) if unit.any() else 0.0
    if modulus <= 0.0:
        raise RecordingError(
            "the force does not grow with the depth: both must be positive where the indenter presses"
        )
    model = _Model(measured, indenter)
    bounds = _parameter_bounds(measured.time, modulus, two_parameters=two_parameters)
    x, jacobian = _solve_bounded(model, bounds, scale)
    predicted = model.force(x)
    error = predicted - measured.force
    deviations = _parameter_deviations(model, x, jacobian * scale, error, bounds)
    friction, deviation = _friction(measured)
    values = model.named(x)
    return Calibration(
        young_modulus=float(values[0]),
        stiffening=float(values[1]) if two_parameters else None,
        surface=float(values[2]),
        relaxation=model.prony(x),
        friction=friction,
        deviations=deviations | ({} if friction is None else {"friction": deviation}),
        predicted=predicted,
        residual=float(np.sqrt(np.mean(error**2))) / scale,
    )


def _parameter_bounds(time: Vector, modulus: float, *, two_parameters: bool) -> tuple[Vector, Vector]:
    """Return the least and the largest parameters, shape (7,); `modulus` (Pa) is a first guess."""
    length, step = float(time[-1] - time[0]), float(np.median(np.diff(time)))
    most = _LARGEST_STIFFENING if two_parameters else _NO_STIFFENING
    least = [np.log(modulus) - 4.0, -0.2, 0.0, 0.0, np.log(step), np.log(0.5), 0.0]
    return np.array(least), np.array(
        [np.log(modulus) + 6.0, 0.5, 0.98, 1.0, np.log(length), np.log(1e3), most]
    )


def _solve_bounded(model: _Model, bounds: tuple[Vector, Vector], scale: float) -> tuple[Vector, Vector]:
    """Return the best parameters, shape (7,), and the derivatives of the force over `scale` there."""
    time = model.measured.time
    length, step = float(time[-1] - time[0]), float(np.median(np.diff(time)))
    guess, most = float(bounds[0][0]) + 4.0, float(bounds[1][-1])
    best = None
    for quick, slow in _STARTS:
        first = max(quick * length, 1.1 * step)
        ratio = max(slow * length / first - 1.0, 0.6)
        start = np.array([guess + 0.3, 0.0, 0.4, 0.5, np.log(first), np.log(ratio), min(1.0, 0.5 * most)])
        found = least_squares(
            lambda x: (model.force(x) - model.measured.force) / scale,
            start,
            bounds=bounds,
            x_scale="jac",
            max_nfev=_MOST_STEPS,
        )
        if best is None or found.cost < best.cost:
            best = found
    assert best is not None
    return np.asarray(best.x, np.float64), np.asarray(best.jac, np.float64)


def _parameter_deviations(
    model: _Model, x: Vector, jacobian: Vector, error: Vector, bounds: tuple[Vector, Vector]
) -> dict[str, float]:
    """Return the standard deviations of the reported values, from the linearised fit.

    Correlated errors count for less: by (1 + r) / (1 - r), r the correlation from sample to sample. A
    parameter not determined by the data has a deviation as large as its range.
    """
    correlation = float(np.corrcoef(error[:-1], error[1:])[0, 1]) if error.std() else 0.0
    alike = (1.0 + correlation) / (1.0 - correlation) if 0.0 < correlation < 1.0 else 1.0
    variance = alike * float(error @ error) / max(1, len(error) - x.size) or np.finfo(float).tiny
    widths = (bounds[1] - bounds[0]) / _UNIFORM
    covariance = np.linalg.inv(jacobian.T @ jacobian / variance + np.diag(widths**-2))
    steps = 1e-6 * np.eye(x.size)
    slopes = np.array([(model.named(x + h) - model.named(x - h)) / 2e-6 for h in steps]).T
    found = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", slopes, covariance, slopes), 0.0))
    return dict(zip(_NAMES, found.tolist(), strict=True))


def _friction(measured: Measured) -> tuple[float | None, float]:
    """Return Coulomb's coefficient while the indenter slides, and the standard deviation."""
    slide, drag = measured.slide, measured.tangential_force
    if slide is None or drag is None:
        return None, 0.0
    speed = np.gradient(slide, measured.time)
    slides = np.abs(speed) > _SLIDING * np.abs(speed).max()
    slides &= measured.force > _PRESSING * measured.force.max()
    if slides.sum() < 2:
        return None, 0.0
    force, against = measured.force[slides], np.abs(drag[slides])
    friction = float(force @ against) / float(force @ force)
    error = against - friction * force
    return friction, float(np.sqrt(error @ error / (error.size - 1) / (force @ force)))
