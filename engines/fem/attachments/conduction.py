"""Heat through ties: from a node of one organ to a face of the other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engines.fem.heat.heat import Heat
from schemas.vectors import Vector

__all__ = ["conduct"]

_CONDUCTIVITY = 0.35
"""Connective tissue, W/(m K): between fat (0.21) and muscle (0.49), IT'IS database; assumed."""
_NARROWEST_M = 2e-4
"""Least length of the way of heat between two organs, m."""


def conduct(
    one: Heat,
    other: Heat,
    nodes: NDArray[np.integer],
    faces: NDArray[np.integer],
    shares: Vector,
    areas: Vector,
    gaps: Vector,
    seconds: float,
) -> None:
    """Let heat go through the whole ties between two bodies for `seconds`.

    Each tie has its part of the capacities of node and face, and goes towards their common temperature as
    an exponential: no tie overshoots, whatever the time.

    Args:
        one: body of the nodes.
        other: body of the faces.
        nodes: tied node of each tie, shape (t,).
        faces: nodes of the face of each tie, shape (t, 3).
        shares: shares of the nodes of the face, shape (t, 3).
        areas: tied areas, m^2, shape (t,).
        gaps: distances between the organs at rest, m, shape (t,).
        seconds: length of the step.
    """
    weights = np.maximum(shares, 0.0)
    weights /= weights.sum(axis=1, keepdims=True)
    uses = np.bincount(faces.ravel(), weights.ravel(), len(other.rise))
    near = one.capacity[nodes] / np.bincount(nodes, minlength=len(one.rise))[nodes]
    far = (weights * (other.capacity / np.maximum(uses, 1e-12))[faces]).sum(axis=1)
    apart = one.rise[nodes] - (weights * other.rise[faces]).sum(axis=1)
    common = near * far / np.maximum(near + far, 1e-30)
    conductance = _CONDUCTIVITY * areas / np.maximum(np.abs(gaps), _NARROWEST_M)
    passed = common * apart * -np.expm1(-conductance * seconds / np.maximum(common, 1e-30))
    one.warm(nodes, -passed)
    other.warm(faces.ravel(), (passed[:, None] * weights).ravel())
