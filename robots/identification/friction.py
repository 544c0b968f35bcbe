"""How sharply dry friction changes with the velocity, chosen from measurements.

The efforts are linear in all parameters but these: each thing that rubs has a smoothing of its Coulomb
friction and, if asked for, a Stribeck velocity. They are taken from a grid, one thing after the other until
nothing changes, so that least squares leave the least. All candidates are columns of one normal matrix,
which makes a trial a small solve.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from robots.dvrk.drives import SMOOTHING
from robots.identification.linear_model import FrictionShape, LinearModel
from schemas.vectors import Vector

__all__ = ["Candidate", "chosen", "grid", "picked"]

_SMOOTHINGS = SMOOTHING * 2.0 ** np.arange(-1, 6)
"""s/rad and s/m: half to 32 times the published one."""
_STRIBECK = np.array([0.003, 0.01, 0.03, 0.1])
"""Velocities, as shares of the fastest that the thing turns by the joints' limits."""
_ROUNDS = 5
_SMALL = 1e-12
"""Of the largest eigenvalue of the scaled normal matrix: below it a direction is not known."""


class Candidate(NamedTuple):
    """One shape on the grid."""

    shape: FrictionShape
    columns: Vector
    """Filtered, those of dry friction, shape (N, n, rubbing or twice that)."""


def grid(model: LinearModel, *, stribeck: bool) -> list[FrictionShape]:
    """Return all shapes on the grid, the same for all things that rub."""
    fastest = np.abs(model.shares) @ np.array([joint.velocity for joint in model.arm.joints])
    return [
        FrictionShape(np.full(len(model.rubbing), smoothing), share * fastest if stribeck else None)
        for smoothing, share in product(_SMOOTHINGS, _STRIBECK if stribeck else (0.0,))
    ]


def chosen(
    shares: Vector, fixed: Vector, dry: list[Candidate], effort: Vector
) -> tuple[FrictionShape, list[int]]:
    """Return the shape that leaves the least, and for each thing that rubs the candidate it is of.

    Args:
        shares: of the model; things that turn alike have one shape.
        fixed: columns of all other base parameters, weighted, shape (N, n, columns).
        dry: the candidates of all recordings together, weighted.
        effort: weighted, shape (N, n).
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

    def explained(picks: list[int]) -> float:
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
            trials = [explained(np.where(alike, pick, picks).tolist()) for pick in range(len(dry))]
            picks[alike] = int(np.argmax(trials))
        if (picks == before).all():
            break
    return _shape([one.shape for one in dry], picks.tolist()), picks.tolist()


def picked(columns: Sequence[Vector], picks: Sequence[int]) -> Vector:
    """Return the columns of candidate `picks[i]` for each thing i that rubs."""
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
