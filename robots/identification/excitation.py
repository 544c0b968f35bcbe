"""Exciting motions of an arm: Fourier series of least condition number, within the arm's limits.

Each period is q(t) = start + sum_k a_k sin(k w t) + b_k (cos(k w t) - 1) in every joint (Swevers et al.,
"Optimal robot excitation and identification", IEEE Transactions on Robotics and Automation 13(5), 1997), with
sum k a_k = 0 and sum k^2 b_k = 0: the motion starts and ends at rest at `start`. The coefficients are scaled
to the limits of position, velocity or acceleration. Minimised is the condition number of the base regressor,
columns of length 1, of this period and all periods before, so each period complements the earlier periods.
The search starts from the best of some random motions, with a fixed seed: the same call gives the same
motion.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from robots.dvrk.cannula import Cannula
from robots.identification.arms import IdentifiedArm
from robots.identification.base_parameters import base_parameters
from robots.identification.linear_model import LinearModel
from schemas.vectors import Vector

__all__ = ["PERIOD", "Excitation", "excitation"]

PERIOD = 20.0
"""s."""
_HARMONICS = 6
"""Number of harmonics, up to 0.3 Hz: faster motions exceed the acceleration limits of the arm's joints."""
_SHARE = 0.9
"""Used fraction of the limits."""
_STATES = 50
"""States of a period in the regressor; ten times as many are checked against the limits."""
_TRIES = 30
_ITERATIONS = 4
_INSERTION = 2


class Excitation(NamedTuple):
    """A motion of the n joints of an arm."""

    time: Vector
    """s, shape (N,)."""
    q: Vector
    """rad and m, shape (N, n)."""
    dq: Vector
    """rad/s and m/s, shape (N, n)."""
    ddq: Vector
    """rad/s^2 and m/s^2, shape (N, n)."""
    condition: float
    """Condition number of the base regressor, columns of length 1."""


class _Series:
    """Fourier series of n joints with J free numbers each, starting and ending at rest at `start`."""

    def __init__(self, arm: IdentifiedArm) -> None:
        k = np.arange(1.0, _HARMONICS + 1.0)
        self._sines = _null_space(k)  # (K, K - 1)
        self._cosines = _null_space(k**2)
        self._frequencies = 2.0 * np.pi / PERIOD * k
        self.start = np.array(arm.start)
        lower = np.array([joint.lower for joint in arm.joints])
        upper = np.array([joint.upper for joint in arm.joints])
        cannula = Cannula.of(arm.chain)
        lower[_INSERTION] = max(lower[_INSERTION], cannula.safe - cannula.offset)
        self._room = _SHARE * (upper - self.start), _SHARE * (self.start - lower)
        self._fastest = _SHARE * np.array([joint.velocity for joint in arm.joints])
        self._hardest = _SHARE * np.array([joint.acceleration for joint in arm.joints])
        self.size = 2 * (_HARMONICS - 1) * len(arm.joints)
        self._dense = self._bases(np.arange(0.0, PERIOD, PERIOD / (10 * _STATES)))

    def _bases(self, time: Vector) -> tuple[Vector, Vector, Vector]:
        """Return the factors of a joint's free numbers in q - start, dq and ddq, each (N, J)."""
        w = self._frequencies
        sin, cos = np.sin(np.outer(time, w)), np.cos(np.outer(time, w))
        return (
            np.hstack([sin @ self._sines, (cos - 1.0) @ self._cosines]),
            np.hstack([(cos * w) @ self._sines, (-sin * w) @ self._cosines]),
            np.hstack([(-sin * w**2) @ self._sines, (-cos * w**2) @ self._cosines]),
        )

    def states(self, free: Vector, time: Vector) -> tuple[Vector, Vector, Vector]:
        """Return q, dq and ddq at `time`, each (N, n), of `free`, shape (J n,), scaled into the limits."""
        numbers = free.reshape(len(self.start), -1).T  # (J, n)
        q, dq, ddq = (base @ numbers for base in self._dense)
        scale = np.min(
            [
                self._room[0] / np.maximum(q.max(axis=0), 1e-12),
                self._room[1] / np.maximum(-q.min(axis=0), 1e-12),
                self._fastest / np.abs(dq).max(axis=0),
                self._hardest / np.abs(ddq).max(axis=0),
            ],
            axis=0,
        )
        q, dq, ddq = (base @ numbers * scale for base in self._bases(time))
        return self.start + q, dq, ddq


def excitation(arm: IdentifiedArm, periods: int, rate: float, seed: int = 0) -> Excitation:
    """Return a motion of `periods` periods with `rate` states in a second (Hz)."""
    model, series, random = LinearModel(arm), _Series(arm), np.random.default_rng(seed)
    columns = base_parameters(model).columns
    weights = 1.0 / np.array([joint.effort for joint in arm.joints])
    coarse = np.arange(0.0, PERIOD, PERIOD / _STATES)
    before: Vector = np.zeros((0, len(columns)))
    condition = np.inf
    found: list[Vector] = []

    def rows(free: Vector) -> Vector:
        regressor = model.regressor(*series.states(free, coarse))[0][..., columns]
        return np.vstack([before, (regressor * weights[:, None]).reshape(-1, len(columns))])

    def cost(free: Vector) -> float:
        return float(np.log(_condition(rows(free))))

    for _ in range(periods):
        tries = random.normal(size=(_TRIES, series.size))
        best = min(tries, key=cost)
        least = minimize(cost, best, method="L-BFGS-B", options={"maxiter": _ITERATIONS}).x
        found.append(least)
        before = np.asarray(np.linalg.qr(rows(least), mode="r"), np.float64)
        condition = _condition(before)
    time = np.arange(0.0, PERIOD - 0.5 / rate, 1.0 / rate)
    states = [series.states(free, time) for free in found]
    states.append(series.states(found[-1], np.array([PERIOD])))  # at rest
    q, dq, ddq = (np.concatenate(part) for part in zip(*states, strict=True))
    return Excitation(np.arange(len(q)) / rate, q, dq, ddq, condition)


def _null_space(row: Vector) -> Vector:
    """Return an orthonormal basis of the complement of `row`, shape (K, K - 1)."""
    return np.linalg.svd(row[None, :])[2][1:].T


def _condition(rows: Vector) -> float:
    lengths = np.linalg.norm(rows, axis=0)
    return float(np.linalg.cond(rows / lengths)) if lengths.all() else np.finfo(float).max
