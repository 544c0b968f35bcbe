"""The efforts of a PSM as a linear function of its dynamic parameters.

effort = sum_b trace(Y_b^T J_b) + armature ddq + stiffness q + offset + friction(dq) of joints and
discs. J_b is the pseudo-inertia of a body of the arm (`robots.dvrk.dynamics`); the instrument's own bodies,
which weigh grams, keep their known masses. Friction is viscous and Coulomb's, smoothed as
`robots.dvrk.drives` has it; of roll and wrist it is in the discs that turn them, which is the coupling of the
cables. SI units, radians.
"""

from __future__ import annotations

import numpy as np

from robots.dvrk import drives, inertia, linkage, psm
from robots.dvrk.dynamics import Dynamics
from robots.dvrk.instruments import Instrument
from schemas.vectors import Vector

__all__ = ["ARM_BODIES", "BODY_SIZE", "LinearModel", "pseudo_inertias"]

_UPPER = np.triu_indices(4)
_TWICE = np.where(_UPPER[0] == _UPPER[1], 1.0, 2.0)
BODY_SIZE = len(_TWICE)
"""Parameters of one body: the upper triangle of its pseudo-inertia, by rows."""
_ARM_JOINTS = len(psm.ARM_JOINTS)
ARM_BODIES = (
    "yaw",
    "pitch",
    "insertion",
    "pitch_back",
    "pitch_front",
    "pitch_bottom",
    "pitch_top",
    "counterweight",
)
"""Whose pseudo-inertias are parameters."""


class LinearModel:
    """The regressor of a PSM with its instrument, the jaw at rest; n joints, P parameters.

    Attributes:
        joints: names of the n joints.
        parts: where each kind of parameter is among the P.
        names: of the P parameters.
        nominal: the published values, shape (P,).
    """

    def __init__(self, tool: Instrument) -> None:
        """Build the model of a PSM with `tool`."""
        chain, bodies = psm.chain(tool), inertia.psm(tool)
        self.joints = tuple(joint.name for joint in chain.joints)
        self._own = Dynamics(
            chain, linkage.PSM, {name: bodies[name] for name in ARM_BODIES}, np.zeros(len(self.joints))
        )
        carried = {name: body for name, body in bodies.items() if name not in ARM_BODIES}
        self._carried = Dynamics(chain, linkage.PSM, carried, np.zeros(len(self.joints)))
        self._carried_pseudo = np.array([body.pseudo_inertia for body in carried.values()])
        driven, discs = drives.psm(tool), drives.discs(tool)
        self._shares = np.array([[disc.shares.get(name, 0.0) for name in self.joints] for disc in discs])
        values = {
            "body": np.array([bodies[name].pseudo_inertia[_UPPER] for name in ARM_BODIES]).ravel(),
            "armature": np.array([driven[name].armature for name in self.joints]),
            "stiffness": np.array([driven[name].elasticity for name in self.joints]),
            "offset": np.array([driven[name].offset for name in self.joints]),
            "viscous": np.array([driven[name].viscous_friction for name in self.joints[:_ARM_JOINTS]]),
            "coulomb": np.array([driven[name].coulomb_friction for name in self.joints[:_ARM_JOINTS]]),
            "disc_viscous": np.array([disc.viscous_friction for disc in discs]),
            "disc_coulomb": np.array([disc.coulomb_friction for disc in discs]),
        }
        ends = np.cumsum([len(value) for value in values.values()]).tolist()
        self.parts = {
            name: slice(end - len(value), end)
            for (name, value), end in zip(values.items(), ends, strict=True)
        }
        self.nominal = np.concatenate(list(values.values()))
        self.names = (
            *(f"{body}.J{i + 1}{j + 1}" for body in ARM_BODIES for i, j in zip(*_UPPER, strict=True)),
            *(f"{part}.{joint}" for part in ("armature", "stiffness", "offset") for joint in self.joints),
            *(f"{part}.{joint}" for part in ("viscous", "coulomb") for joint in self.joints[:_ARM_JOINTS]),
            *(f"{part}.{i + 1}" for part in ("disc_viscous", "disc_coulomb") for i in range(len(discs))),
        )

    def regressor(self, q: Vector, dq: Vector, ddq: Vector) -> Vector:
        """Return the derivatives of the efforts by the parameters, shape (N, n, P); arguments (N, n)."""
        count, n = q.shape
        bodies = np.array([self._own.effort_gradients(*row) for row in zip(q, dq, ddq, strict=True)])
        turned = dq @ self._shares.T  # (N, discs)
        parts = [
            (bodies[..., _UPPER[0], _UPPER[1]] * _TWICE).reshape(count, n, -1),
            _diagonal(ddq),
            _diagonal(q),
            _diagonal(np.ones_like(q)),
            _diagonal(dq)[..., :_ARM_JOINTS],
            _diagonal(_direction(dq))[..., :_ARM_JOINTS],
            self._shares.T * turned[:, None, :],
            self._shares.T * _direction(turned)[:, None, :],
        ]
        return np.concatenate(parts, axis=-1)

    def carried(self, q: Vector, dq: Vector, ddq: Vector) -> Vector:
        """Return the efforts that the instrument's own bodies need, shape (N, n); arguments (N, n)."""
        gradients = np.array([self._carried.effort_gradients(*row) for row in zip(q, dq, ddq, strict=True)])
        return np.einsum("kibcd,bcd->ki", gradients, self._carried_pseudo)


def pseudo_inertias(parameters: Vector) -> Vector:
    """Return the pseudo-inertias, shape (bodies, 4, 4), of the bodies' parameters, shape (10 bodies,)."""
    rows = parameters.reshape(-1, BODY_SIZE)
    result = np.zeros((len(rows), 4, 4))
    result[:, _UPPER[0], _UPPER[1]] = result[:, _UPPER[1], _UPPER[0]] = rows
    return result


def _diagonal(values: Vector) -> Vector:
    """Return a diagonal matrix for each row: (N, n) to (N, n, n)."""
    return values[:, :, None] * np.eye(values.shape[1])


def _direction(dq: Vector) -> Vector:
    return np.tanh(drives.SMOOTHING * dq)
