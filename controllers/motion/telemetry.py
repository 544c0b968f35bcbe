"""The states that one arm publishes: joint and Cartesian states, wrenches, Jacobians and known weight."""

from __future__ import annotations

import numpy as np

from controllers.motion.frames import pose, turned
from robots.dvrk import inertia
from robots.dvrk.dynamics import STANDARD_GRAVITY, Dynamics
from robots.dvrk.linkage import Linkage
from robots.dvrk.setup_joints import CartArm
from robots.serial_chain import SerialChain
from schemas.vectors import Vector

__all__ = ["KnownWeight", "Telemetry", "body_to_spatial"]

_SINGULAR = 1e-6
"""Singular values of the Jacobian below this share of the largest do not count for the wrench at the tip."""


def body_to_spatial(tip: Vector) -> Vector:
    """Return the adjoint, shape (6, 6), of the tip's pose, shape (4, 4).

    It takes the tip's body twist (linear part first) to the spatial one: that of the point at the base
    frame's origin, in the base frame (Murray, Li, Sastry, A Mathematical Introduction to Robotic
    Manipulation, section 2.4), as on the dVRK's `spatial/` ports.
    """
    rotation, (x, y, z) = tip[:3, :3], tip[:3, 3].tolist()
    adjoint = np.zeros((6, 6))
    adjoint[:3, :3] = adjoint[3:, 3:] = rotation
    adjoint[:3, 3:] = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]) @ rotation
    return adjoint


class Telemetry:
    """The state outputs of one arm. The arrays stay the same ones."""

    def __init__(self, arm: str, chain: SerialChain) -> None:
        """Take the arm's name and kinematics."""
        self._chain = chain
        n = len(chain.joints)
        sizes = {"measured_js": 3 * n, "setpoint_js": 3 * n, "body/measured_cf": 6, "spatial/measured_cf": 6}
        sizes |= {"body/jacobian": 6 * n, "spatial/jacobian": 6 * n, "gravity_compensation/setpoint_js": n}
        sizes |= {f"trajectory_j/{name}": 1 for name in ("ratio", "ratio_v", "ratio_a")}
        sizes |= {
            f"{prefix}{kind}_{part}": size
            for prefix in ("", "local/")
            for kind in ("measured", "setpoint")
            for part, size in (("cp", 7), ("cv", 6))
        }
        self._values = {name: np.zeros(size) for name, size in sizes.items()}
        self._base = np.zeros(7)
        self.outputs = {f"{arm}/{name}": value for name, value in self._values.items()} | {
            f"SUJ/{arm}/measured_cp": self._base
        }

    def update_settings(self, ratio: Vector, carried: Vector) -> None:
        """Update what commands set.

        Args:
            ratio: shares of velocity and acceleration that moves use, shape (2,).
            carried: efforts that carry the known weight, shape (n,).
        """
        values, (faster, harder) = self._values, ratio.tolist()
        values["trajectory_j/ratio_v"][0], values["trajectory_j/ratio_a"][0] = faster, harder
        values["trajectory_j/ratio"][0] = faster if faster == harder else 0.0
        values["gravity_compensation/setpoint_js"][:] = carried

    def update(self, measured: Vector, setpoint: Vector, base: Vector, *, absolute: bool) -> None:
        """Update all states.

        Args:
            measured: positions, velocities and efforts as measured, shape (3 n,).
            setpoint: the same as commanded.
            base: pose of the arm's base frame in its reference, shape (4, 4).
            absolute: whether the body wrench is along the axes of the reference.
        """
        values, n = self._values, len(self._chain.joints)
        values["measured_js"][:], values["setpoint_js"][:] = measured, setpoint
        self._base[:] = pose(base)
        self._update_tip("setpoint", setpoint, base)
        tip, jacobian = self._update_tip("measured", measured, base)
        to_tip = tip[:3, :3].T
        body = np.vstack([to_tip @ jacobian[:3], to_tip @ jacobian[3:]])
        spatial = body_to_spatial(tip) @ body
        for name, matrix in (("body", body), ("spatial", spatial)):
            values[f"{name}/jacobian"][:] = matrix.ravel()
            values[f"{name}/measured_cf"][:] = np.linalg.pinv(matrix.T, rcond=_SINGULAR) @ measured[2 * n :]
        if absolute:
            values["body/measured_cf"][:] = turned(base[:3, :3] @ tip[:3, :3], values["body/measured_cf"])

    def _update_tip(self, kind: str, state: Vector, base: Vector) -> tuple[Vector, Vector]:
        """Write pose and twist of the tip; return its pose and Jacobian in the arm's base frame."""
        values, n = self._values, len(self._chain.joints)
        frames = self._chain.frames(state[:n])
        tip, jacobian = frames[-1], self._chain.jacobian(frames)
        values[f"local/{kind}_cp"][:], values[f"{kind}_cp"][:] = pose(tip), pose(base @ tip)
        twist = jacobian @ state[n : 2 * n]
        values[f"local/{kind}_cv"][:] = twist
        values[f"{kind}_cv"][:] = turned(base[:3, :3], twist)
        return tip, jacobian


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
