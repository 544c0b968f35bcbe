"""Least squares with linear inequalities, for a handful of unknowns.

Lawson and Hanson, Solving Least Squares Problems (SIAM, 1995), chapter 23: least squares with inequalities
becomes least distance programming (problem LDP), and that becomes non-negative least squares (NNLS).
"""

from __future__ import annotations

from typing import cast

import numpy as np

from schemas.vectors import Vector

__all__ = ["non_negative", "solve_constrained"]

_TOLERANCE = 1e-11
"""Tolerance of comparisons with 0, relative to numbers of the order of 1."""


def solve_constrained(a: Vector, b: Vector, g: Vector, h: Vector) -> Vector:
    """Return the x, shape (n,), of the least |a x - b| with g x <= h.

    Args:
        a: shape (k, n), of full column rank.
        b: shape (k,).
        g: shape (m, n); a row of zeros forbids nothing.
        h: shape (m,), none below 0, so that x = 0 is allowed.
    """
    q, r = np.linalg.qr(a)
    centre = q.T @ b
    free = cast("Vector", np.linalg.solve(r, centre))
    if bool((g @ free <= h).all()):
        return free
    # z = r x - centre: the least |z| with rows z <= most
    rows = cast("Vector", np.linalg.solve(r.T, g.T)).T  # (m, n)
    most = h - rows @ centre
    size = np.sqrt((rows**2).sum(axis=1))
    used = size > 0.0
    rows, most = rows[used] / size[used, None], most[used] / size[used]
    system = -np.vstack([rows.T, most])  # (n + 1, m)
    target = np.zeros(len(system))
    target[-1] = 1.0
    rest = system @ non_negative(system, target) - target
    if float(rest[-1]) > -_TOLERANCE:  # nothing but x = 0 is allowed
        return np.zeros_like(free)
    nearest = centre - rest[:-1] / rest[-1]
    return cast("Vector", np.linalg.solve(r, nearest))


def non_negative(a: Vector, b: Vector) -> Vector:
    """Return the x >= 0, shape (m,), of the least |a x - b|; `a` has shape (k, m) (same source, NNLS)."""
    m = a.shape[1]
    x, active = np.zeros(m), np.zeros(m, dtype=bool)
    scale = max(1.0, float(np.abs(a).max(initial=0.0)))
    for _ in range(3 * m):
        gradient = a.T @ (b - a @ x)
        gradient[active] = -np.inf
        best = int(gradient.argmax())
        if gradient[best] <= _TOLERANCE * scale:
            break
        active[best] = True
        while True:
            z = np.zeros(m)
            z[active] = np.linalg.lstsq(a[:, active], b, rcond=None)[0]
            low = active & (z <= 0.0)
            if not low.any():
                x = z
                break
            share = float((x[low] / (x[low] - z[low])).min())
            x += share * (z - x)
            active &= x > _TOLERANCE
            x[~active] = 0.0
    return x
