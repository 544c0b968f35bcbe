"""Shape of dry friction over velocity, chosen from measurements.

The efforts are linear in all parameters but the shapes: each rubbing pair has a smoothing of its Coulomb
friction and optionally a Stribeck velocity. Shapes are chosen on a grid for the least residual, pair after
pair until no change helps. All candidates are columns of one normal matrix, so a trial is a small solve.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from robots.dvrk.drive import SMOOTHING
from robots.identification.linear_model import FrictionShape, LinearModel
from schemas.vectors import Vector

__all__ = ["Candidate", "choose_shape", "columns_of_picks", "grid"]

_SMOOTHINGS = SMOOTHING * 2.0 ** np.arange(-1, 6)
"""Smoothings, s/rad and s/m: half to 32 times the published value."""
_STRIBECK = np.array([0.003, 0.01, 0.03, 0.1])
"""Stribeck velocities, as fractions of the largest velocity of the pair at the joints' limits."""
_ROUNDS = 5
_SMALL = 1e-12
"""Smallest relevant eigenvalue of the scaled normal matrix, relative to the largest."""


class Candidate(NamedTuple):
    """A shape on the grid."""

    shape: FrictionShape
    columns: Vector
    """Filtered columns of dry friction, shape (N, n, pairs or 2 pairs)."""


def grid(model: LinearModel, *, stribeck: bool) -> list[FrictionShape]:
    """Return all shapes on the grid, the same for all rubbing pairs."""
    fastest = np.abs(model.shares) @ np.array([joint.velocity for joint in model.arm.joints])
    return [
        FrictionShape(np.full(len(model.rubbing), smoothing), share * fastest if stribeck else None)
        for smoothing, share in product(_SMOOTHINGS, _STRIBECK if stribeck else (0.0,))
    ]


def choose_shape(
    shares: Vector, fixed: Vector, dry: list[Candidate], effort: Vector
) -> tuple[FrictionShape, list[int]]:
    """Return the shape of least residual, and the candidate of each rubbing pair.

    Args:
        shares: shares of the model; pairs with equal motion have the same shape.
        fixed: weighted columns of all base parameters without dry friction, shape (N, n, columns).
        dry: weighted candidates of all recordings together.
        effort: weighted efforts, shape (N, n).
    """
    rubbing = len(dry[0].shape.smoothing)
    kinds = dry[0].columns.shape[-1] // rubbing
    turning = np.abs(shares).round(9)
    groups = [(turning == one).all(axis=1) for one in np.unique(turning, axis=0)]
    every = np.concatenate([fixed, *(one.columns for one in dry)], axis=-1).reshape(effort.size, -1)
    lengths = np.maximum(np.linalg.norm(every, axis=0), np.finfo(float).tiny)
    every /= lengths
    normal, goal = every.T @ every, every.T @ effort.ravel()
    first = fixed.shape[-1] + np.arange(len(dry)) * rubbing * kinds

    def explained_share(picks: list[int]) -> float:
        columns = list(range(fixed.shape[-1]))
        for i, pick in enumerate(picks):
            columns += [int(first[pick]) + kind * rubbing + i for kind in range(kinds)]
        values, vectors = np.linalg.eigh(normal[np.ix_(columns, columns)])
        known = values > _SMALL * values[-1]
        return float(np.sum((vectors.T @ goal[columns])[known] ** 2 / values[known]))

    picks = np.zeros(rubbing, int)
    for _ in range(_ROUNDS):
        before = picks.copy()
        for alike in groups:
            trials = [explained_share(np.where(alike, pick, picks).tolist()) for pick in range(len(dry))]
            picks[alike] = int(np.argmax(trials))
        if (picks == before).all():
            break
    return _shape([one.shape for one in dry], picks.tolist()), picks.tolist()


def columns_of_picks(columns: Sequence[Vector], picks: Sequence[int]) -> Vector:
    """Return the columns of candidate `picks[i]` for each rubbing pair i."""
    result = np.empty_like(columns[0])
    for i, pick in enumerate(picks):
        result[..., i :: len(picks)] = columns[pick][..., i :: len(picks)]
    return result


def _shape(shapes: Sequence[FrictionShape], picks: Sequence[int]) -> FrictionShape:
    smoothing = np.array([shapes[pick].smoothing[i] for i, pick in enumerate(picks)])
    velocities = [one.stribeck for one in shapes if one.stribeck is not None]
    return FrictionShape(
        smoothing, np.array([velocities[pick][i] for i, pick in enumerate(picks)]) if velocities else None
    )
