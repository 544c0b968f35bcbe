"""The states that arms publish: joint and Cartesian states, wrenches, Jacobians and known weight.

Arms of as many joints are computed together, and only when one of them has changed since they last published.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controllers.motion.frames import turned
from robots.dvrk import inertia
from robots.dvrk.dynamics import STANDARD_GRAVITY, Dynamics
from robots.dvrk.linkage import Linkage
from robots.dvrk.setup_joints import CartArm
from robots.rotation import from_matrices
from robots.serial_chain import SerialChain, SerialChains
from schemas.vectors import Vector

__all__ = ["KnownWeight", "Telemetry", "TelemetryRow", "body_to_spatial"]

_SINGULAR = 1e-6
"""Singular values of the Jacobian below this share of the largest do not count for the wrench at the tip."""
_POSES = (
    "SUJ/{}/measured_cp",
    *(f"{{}}/{local}{kind}_cp" for kind in ("setpoint", "measured") for local in ("local/", "")),
)
_TWISTS = tuple(f"{{}}/{local}{kind}_cv" for kind in ("setpoint", "measured") for local in ("local/", ""))
_RATIOS, _KINDS = ("ratio_v", "ratio_a", "ratio"), ("body", "spatial")


def body_to_spatial(tip: Vector) -> Vector:
    """Return the adjoint, shape (..., 6, 6), of the tip's pose, shape (..., 4, 4).

    It takes the tip's body twist (linear part first) to the spatial one: that of the point at the base
    frame's origin, in the base frame (Murray, Li, Sastry, A Mathematical Introduction to Robotic
    Manipulation, section 2.4), as on the dVRK's `spatial/` ports.
    """
    rotation, (x, y, z) = tip[..., :3, :3], np.moveaxis(tip[..., :3, 3], -1, 0)
    across = np.zeros((*tip.shape[:-2], 3, 3))
    across[..., 0, 1], across[..., 0, 2], across[..., 1, 2] = -z, y, -x
    across[..., 1, 0], across[..., 2, 0], across[..., 2, 1] = z, -y, x
    adjoint = np.zeros((*tip.shape[:-2], 6, 6))
    adjoint[..., :3, :3] = adjoint[..., 3:, 3:] = rotation
    adjoint[..., :3, 3:] = across @ rotation
    return adjoint


@dataclass
class TelemetryRow:
    """What the states of one arm are computed from; its controller writes here before each `update`."""

    setpoint: Vector
    """Positions, velocities and efforts as commanded, shape (3 n,)."""
    measured: Vector
    """The same as measured."""
    base: Vector
    """Pose of the arm's base frame in its reference, shape (4, 4)."""
    ratio: Vector
    """Shares of velocity and acceleration that moves use, shape (2,)."""
    switches: Vector
    """Whether the body wrench is along the axes of the reference, and whether the drives carry the weight."""


class Telemetry:
    """The state outputs of k arms of n joints each. The arrays stay the same ones."""

    def __init__(self, arms: Sequence[tuple[str, SerialChain, KnownWeight]]) -> None:
        """Take the arms' names, kinematics, and the weights that they carry."""
        k, n = len(arms), len(arms[0][1].joints)
        self._n, self._chain = n, arms[0][1]
        self._chains = SerialChains([chain for _, chain, _ in arms])
        self._weights = [weight for *_, weight in arms]
        self._given, self._seen = np.zeros((k, 6 * n + 20)), b""
        self._state = self._given[:, : 6 * n].reshape(k, 2, 3, n)  # setpoint, then measured
        self._base = self._given[:, 6 * n : 6 * n + 16].reshape(k, 4, 4)
        self._ratio, self._switches = self._given[:, -4:-2], self._given[:, -2:]
        self.rows = [
            TelemetryRow(row[: 3 * n], row[3 * n : 6 * n], base, row[-4:-2], row[-2:])
            for row, base in zip(self._given, self._base, strict=True)
        ]
        """What to write to, in the order of the arms."""
        self._frames = np.zeros((k, 5, 4, 4))
        self._poses, self._twists = np.zeros((k, 5, 7)), np.zeros((k, 4, 6))
        self._jacobians, self._wrenches = np.zeros((k, 2, 6, n)), np.zeros((k, 2, 6))  # body, then spatial
        self._ratios, self._carried = np.zeros((k, 3)), np.zeros((k, n))
        self.outputs: dict[str, Vector] = {}
        for i, (arm, *_) in enumerate(arms):
            self.outputs |= self._outputs_of(i, arm)

    def _outputs_of(self, i: int, arm: str) -> dict[str, Vector]:
        row = self.rows[i]
        return {
            f"{arm}/measured_js": row.measured,
            f"{arm}/setpoint_js": row.setpoint,
            f"{arm}/gravity_compensation/setpoint_js": self._carried[i],
            **{name.format(arm): pose for name, pose in zip(_POSES, self._poses[i], strict=True)},
            **{name.format(arm): twist for name, twist in zip(_TWISTS, self._twists[i], strict=True)},
            **{f"{arm}/trajectory_j/{name}": self._ratios[i, j : j + 1] for j, name in enumerate(_RATIOS)},
            **{f"{arm}/{kind}/jacobian": self._jacobians[i, j].reshape(-1) for j, kind in enumerate(_KINDS)},
            **{f"{arm}/{kind}/measured_cf": self._wrenches[i, j] for j, kind in enumerate(_KINDS)},
        }

    def update(self) -> None:
        """Compute all states from `rows`, unless those have the bits of the last time."""
        given = self._given.tobytes()
        if given == self._seen:
            return
        self._seen = given
        self._update_settings()
        frames = self._chains.frames(self._state[:, :, 0])  # (k, 2, n + 1, 4, 4)
        jacobian = self._chain.jacobian(frames)  # (k, 2, 6, n)
        self._update_poses(frames[:, :, -1])
        self._update_twists(jacobian)
        self._update_wrenches(frames[:, 1, -1], jacobian[:, 1])

    def _update_settings(self) -> None:
        faster, harder = self._ratio.T
        self._ratios[:, :2] = self._ratio
        self._ratios[:, 2] = np.where(faster == harder, faster, 0.0)
        for i, weight in enumerate(self._weights):
            self._carried[i] = self._switches[i, 1] * weight.effort(self._state[i, 1, 0])

    def _update_poses(self, tips: Vector) -> None:
        """Write the poses of the bases, and of the tips as commanded and as measured, (k, 2, 4, 4)."""
        frames = self._frames
        frames[:, 0], frames[:, 1::2] = self._base, tips
        frames[:, 2::2] = self._base[:, None] @ tips
        self._poses[..., :3] = frames[..., :3, 3]
        self._poses[..., 3:] = from_matrices(frames.reshape(-1, 4, 4)).reshape(-1, 5, 4)

    def _update_twists(self, jacobian: Vector) -> None:
        k = len(self.rows)
        twists = (jacobian @ self._state[:, :, 1, :, None]).reshape(k, 2, 6)
        self._twists[:, ::2] = twists
        parts = self._base[:, None, None, :3, :3] @ twists.reshape(k, 2, 2, 3, 1)
        self._twists[:, 1::2] = parts.reshape(k, 2, 6)

    def _update_wrenches(self, tips: Vector, jacobian: Vector) -> None:
        """Write the Jacobians of the measured positions, and the wrenches that balance their efforts."""
        k, n = len(self.rows), self._n
        to_tip = tips[:, None, :3, :3].swapaxes(-1, -2)
        body = (to_tip @ jacobian.reshape(k, 2, 3, n)).reshape(k, 6, n)
        self._jacobians[:, 0], self._jacobians[:, 1] = body, body_to_spatial(tips) @ body
        inverse = np.linalg.pinv(self._jacobians.swapaxes(-1, -2), rcond=_SINGULAR)  # (k, 2, 6, n)
        self._wrenches[:] = (inverse @ self._state[:, 1:, 2, :, None])[..., 0]
        for i in np.flatnonzero(self._switches[:, 0]).tolist():
            self._wrenches[i, 0] = turned(self._base[i, :3, :3] @ tips[i, :3, :3], self._wrenches[i, 0])


class KnownWeight:
    """The weight that the real controller carries: the endoscope's.

    All else of an arm is balanced by springs and weights (docs/decisions/0010).
    """

    def __init__(self, arm: CartArm, chain: SerialChain, base: Vector) -> None:
        """Take the arm, its kinematics, and the pose of its base frame in the world, shape (4, 4)."""
        self._gravity = base[:3, :3].T @ np.array([0.0, 0.0, -STANDARD_GRAVITY])
        self._nothing = np.zeros(len(chain.joints))
        self._dynamics = None
        if arm == "ECM":
            self._dynamics = Dynamics(chain, Linkage((), ()), {"roll": inertia.ecm()["roll"]}, self._nothing)

    def effort(self, q: Vector) -> Vector:
        """Return the efforts (N m, N), shape (n,), that carry it at joint positions `q`, shape (n,)."""
        return self._nothing if self._dynamics is None else self._dynamics.gravity(q, self._gravity)
