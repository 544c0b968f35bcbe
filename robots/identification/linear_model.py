"""Efforts of an arm as a linear function of the dynamic parameters.

effort = sum_b trace(Y_b^T J_b) + armature ddq + stiffness q + offset + friction. J_b is the pseudo-inertia of
a body of the arm (`robots.dvrk.dynamics`). Rubbing pairs are the arm's own joints and the discs of an
instrument, each turning at v = sum of share dq; the friction viscous v + coulomb tanh(s v) of a pair acts on
the joints by the same shares, the coupling of the cables. Stribeck's friction adds static exp(-(v / w)^2)
tanh(s v) (Armstrong et al., "A survey of models, analysis tools and compensation methods for the control of
machines with friction", Automatica 30(7), 1994). The efforts are not linear in s and w (`FrictionShape`). SI
units, radians.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robots.dvrk.drive import SMOOTHING
from robots.dvrk.dynamics import Dynamics
from robots.identification.arms import IdentifiedArm
from schemas.vectors import Vector

__all__ = ["BODY_SIZE", "FrictionShape", "LinearModel", "pseudo_inertias"]

_UPPER = np.triu_indices(4)
_TWICE = np.where(_UPPER[0] == _UPPER[1], 1.0, 2.0)
BODY_SIZE = len(_TWICE)
"""Number of parameters of a body: the upper triangle of the pseudo-inertia, by rows."""
_AT_ONCE = 1000
"""Number of states per computation of the regressor: some megabytes."""


class FrictionShape(NamedTuple):
    """Nonlinear parameters of friction, for each rubbing pair."""

    smoothing: Vector
    """Sharpness s of Coulomb friction's change of sign, s/rad or s/m, shape (rubbing,)."""
    stribeck: Vector | None = None
    """Velocity w of static friction at 1/e, rad/s or m/s; None: no static friction."""


class LinearModel:
    """The regressor of an arm; n joints, P parameters.

    Attributes:
        arm: the arm.
        gravity: gravity in the arm's base frame, or None.
        joints: names of the n joints.
        rubbing: names of the rubbing pairs: joints and discs.
        shares: velocity of each pair per velocity of each joint, shape (rubbing, n).
        shape: shape of the friction.
        parts: positions of each kind of parameter among the P parameters.
        names: names of the P parameters.
        nominal: published values, shape (P,).
    """

    def __init__(
        self, arm: IdentifiedArm, gravity: Vector | None = None, shape: FrictionShape | None = None
    ) -> None:
        """Build the model of `arm`.

        Args:
            arm: the arm.
            gravity: gravity in the arm's base frame, m/s^2, shape (3,); by default for an upright base.
            shape: shape of the friction; by default Coulomb friction as published.
        """
        self.arm, self.joints = arm, tuple(joint.name for joint in arm.joints)
        self.gravity, moving = gravity, len(arm.chain.joints)
        self._dynamics = Dynamics(arm.chain, arm.bars, {**arm.bodies, **arm.carried}, np.zeros(moving))
        self._carried = np.array([body.pseudo_inertia for body in arm.carried.values()]).reshape(-1, 4, 4)
        pairs = (*arm.discs, *arm.fingers)
        turned = {name for disc in arm.discs for name in disc.shares}
        own = [name for name in self.joints if name not in turned]
        self.rubbing = (
            *own,
            *(f"disc_{i + 1}" for i in range(len(arm.discs))),
            *(f"finger_pair_{i + 1}" for i in range(len(arm.fingers))),
        )
        self.shares = np.array(
            [[float(name == joint) for joint in self.joints] for name in own]
            + [[disc.shares.get(joint, 0.0) for joint in self.joints] for disc in pairs]
        )
        self.shape = shape or FrictionShape(np.full(len(self.rubbing), SMOOTHING))
        of_joints, losses = [arm.drives[name] for name in self.joints], [arm.drives[name] for name in own]
        values = {
            "body": np.array([body.pseudo_inertia[_UPPER] for body in arm.bodies.values()]).ravel(),
            "armature": np.array([drive.armature for drive in of_joints]),
            "stiffness": np.array([drive.elasticity for drive in of_joints]),
            "offset": np.array([drive.offset for drive in of_joints]),
            "viscous": np.array([one.viscous_friction for one in (*losses, *pairs)]),
            "coulomb": np.array([one.coulomb_friction for one in (*losses, *pairs)]),
        }
        if self.shape.stribeck is not None:
            values["static"] = np.zeros(len(self.rubbing))
        ends = np.cumsum([len(value) for value in values.values()]).tolist()
        self.parts = {
            name: slice(end - len(value), end)
            for (name, value), end in zip(values.items(), ends, strict=True)
        }
        self.nominal = np.concatenate(list(values.values()))
        rows = {"armature": self.joints, "stiffness": self.joints, "offset": self.joints}
        self.names = (
            *(f"{body}.J{i + 1}{j + 1}" for body in arm.bodies for i, j in zip(*_UPPER, strict=True)),
            *(f"{part}.{row}" for part in list(values)[1:] for row in rows.get(part, self.rubbing)),
        )

    def regressor(self, q: Vector, dq: Vector, ddq: Vector) -> tuple[Vector, Vector]:
        """Return the derivatives of the efforts by the parameters, and the efforts of the known parameters.

        Arguments (N, n); results (N, n, P) and (N, n).
        """
        parts = [
            self._regressor_of_some(*(values[first : first + _AT_ONCE] for values in (q, dq, ddq)))
            for first in range(0, len(q), _AT_ONCE)
        ]
        regressor, carried = (np.concatenate(column) for column in zip(*parts, strict=True))
        return regressor, carried

    def _regressor_of_some(self, q: Vector, dq: Vector, ddq: Vector) -> tuple[Vector, Vector]:
        (count, n), moving = q.shape, len(self.arm.chain.joints)
        gradients = np.zeros((count, n, len(self.arm.bodies) + len(self._carried), 4, 4))
        gradients[:, :moving] = self._dynamics.effort_gradients(
            q[:, :moving], dq[:, :moving], ddq[:, :moving], self.gravity
        )
        bodies, known = np.split(gradients, [len(self.arm.bodies)], axis=2)
        parts = [
            (bodies[..., _UPPER[0], _UPPER[1]] * _TWICE).reshape(count, n, -1),
            _diagonal_matrices(ddq),
            _diagonal_matrices(q),
            _diagonal_matrices(np.ones_like(q)),
            self.spread(dq @ self.shares.T),
            self.dry(dq, self.shape),
        ]
        return np.concatenate(parts, axis=-1), np.einsum("kibcd,bcd->ki", known, self._carried)

    def dry(self, dq: Vector, shape: FrictionShape) -> Vector:
        """Return the columns of dry friction at joint velocities (N, n): Coulomb's, then static."""
        v = dq @ self.shares.T
        direction = np.tanh(shape.smoothing * v)
        coulomb = self.spread(direction)
        if shape.stribeck is None:
            return coulomb
        return np.concatenate([coulomb, self.spread(direction * np.exp(-((v / shape.stribeck) ** 2)))], -1)

    def spread(self, values: Vector) -> Vector:
        """Return the joint efforts, shape (N, n, rubbing), of friction `values`, (N, rubbing)."""
        return self.shares.T * values[:, None, :]


def pseudo_inertias(parameters: Vector) -> Vector:
    """Return the pseudo-inertias, shape (bodies, 4, 4), of the bodies' parameters, shape (10 bodies,)."""
    rows = parameters.reshape(-1, BODY_SIZE)
    result = np.zeros((len(rows), 4, 4))
    result[:, _UPPER[0], _UPPER[1]] = result[:, _UPPER[1], _UPPER[0]] = rows
    return result


def _diagonal_matrices(values: Vector) -> Vector:
    """Return a diagonal matrix for each row: (N, n) to (N, n, n)."""
    return values[:, :, None] * np.eye(values.shape[1])
