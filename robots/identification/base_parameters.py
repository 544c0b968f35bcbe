"""Base parameters: the identifiable combinations of an arm's parameters.

Measurements tell combinations only. QR with column pivoting picks independent columns W1 of a regressor W;
the others are W2 = W1 K, so that W p = W1 (p1 + K p2) (Gautier, "Numerical calculation of the base inertial
parameters of robots", ICRA 1990).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from robots.identification.linear_model import LinearModel
from schemas.vectors import Vector

__all__ = ["BaseParameters", "base_parameters"]

_STATES = 300
_SLOWEST = 1e-3
"""Smallest random velocity, as a fraction of the limit: dry friction differs at low velocities."""
_TOLERANCE = 1e-8
"""Smallest relevant diagonal element of R, relative to the largest, with columns of length 1: smaller
elements are errors of the central difference.
"""


class BaseParameters(NamedTuple):
    """How P parameters combine to B base parameters."""

    columns: NDArray[np.intp]
    """Columns of the regressor for the base parameters, shape (B,)."""
    combination: Vector
    """Map from all parameters to the base parameters, shape (B, P)."""


def base_parameters(model: LinearModel) -> BaseParameters:
    """Return the base parameters of `model`: of all motions within the joints' limits.

    The motions are random, with a fixed seed; the result depends on the structure of the arm alone.
    """
    joints, random = model.arm.joints, np.random.default_rng(0)
    lower, upper = np.array([[joint.lower, joint.upper] for joint in joints]).T
    speed = np.array([joint.velocity for joint in joints])
    shape = (_STATES, len(joints))
    q = random.uniform(lower, upper, shape)
    dq = speed * random.choice((-1.0, 1.0), shape) * _SLOWEST ** random.uniform(0.0, 1.0, shape)
    ddq = 5.0 * random.uniform(-speed, speed, shape)
    stacked = model.regressor(q, dq, ddq)[0].reshape(-1, len(model.nominal))
    lengths = np.linalg.norm(stacked, axis=0)
    lengths[lengths < _TOLERANCE * lengths.max()] = 1.0
    triangle, order = qr(stacked / lengths, mode="r", pivoting=True)
    diagonal = np.abs(np.diag(triangle))
    rank = int((diagonal > _TOLERANCE * diagonal[0]).sum())
    shared = np.linalg.solve(triangle[:rank, :rank], triangle[:rank, rank:])
    combination = np.zeros((rank, len(order)))
    combination[:, order[:rank]] = np.eye(rank)
    combination[:, order[rank:]] = shared * lengths[order[rank:]] / lengths[order[:rank], None]
    return BaseParameters(order[:rank], combination)
