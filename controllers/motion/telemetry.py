"""What one arm tells of itself: joint and Cartesian states, velocities, wrenches and Jacobians."""

from __future__ import annotations

import numpy as np

from controllers.motion.frames import pose, turned
from robots.serial_chain import SerialChain
from schemas.vectors import Vector

__all__ = ["Telemetry", "body_to_spatial"]

_SINGULAR = 1e-6
"""Singular values of the Jacobian below this share of the largest say nothing about the wrench at the tip."""


def body_to_spatial(tip: Vector) -> Vector:
    """Return the adjoint, shape (6, 6), of the tip's pose: takes its body twist (linear part first) to the
    spatial one.

    The spatial twist is that of the point at the base frame's origin, in the base frame (Murray, Li, Sastry,
    A Mathematical Introduction to Robotic Manipulation, section 2.4), which is what the dVRK's `spatial/`
    ports are about.
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

    def tell_settings(self, ratio: Vector, borne: Vector) -> None:
        """Tell the shares of velocity and acceleration that moves use, shape (2,), and the efforts that bear
        the known weight, shape (n,).
        """
        values, (faster, harder) = self._values, ratio.tolist()
        values["trajectory_j/ratio_v"][0], values["trajectory_j/ratio_a"][0] = faster, harder
        values["trajectory_j/ratio"][0] = faster if faster == harder else 0.0
        values["gravity_compensation/setpoint_js"][:] = borne

    def update(self, measured: Vector, setpoint: Vector, base: Vector, *, absolute: bool) -> None:
        """Bring all states up to date.

        Args:
            measured: positions, velocities and efforts as measured, shape (3 n,).
            setpoint: the same as commanded.
            base: pose of the arm's base frame in its reference, shape (4, 4).
            absolute: whether the body wrench is told along the axes of the reference.
        """
        values, n = self._values, len(self._chain.joints)
        values["measured_js"][:], values["setpoint_js"][:] = measured, setpoint
        self._base[:] = pose(base)
        self._tell("setpoint", setpoint, base)
        tip, jacobian = self._tell("measured", measured, base)
        to_tip = tip[:3, :3].T
        body = np.vstack([to_tip @ jacobian[:3], to_tip @ jacobian[3:]])
        spatial = body_to_spatial(tip) @ body
        for name, matrix in (("body", body), ("spatial", spatial)):
            values[f"{name}/jacobian"][:] = matrix.ravel()
            values[f"{name}/measured_cf"][:] = np.linalg.pinv(matrix.T, rcond=_SINGULAR) @ measured[2 * n :]
        if absolute:
            values["body/measured_cf"][:] = turned(base[:3, :3] @ tip[:3, :3], values["body/measured_cf"])

    def _tell(self, kind: str, state: Vector, base: Vector) -> tuple[Vector, Vector]:
        """Write pose and twist of the tip; return its pose and Jacobian in the arm's base frame."""
        values, n = self._values, len(self._chain.joints)
        frames = self._chain.frames(state[:n])
        tip, jacobian = frames[-1], self._chain.jacobian(frames)
        values[f"local/{kind}_cp"][:], values[f"{kind}_cp"][:] = pose(tip), pose(base @ tip)
        twist = jacobian @ state[n : 2 * n]
        values[f"local/{kind}_cv"][:] = twist
        values[f"{kind}_cv"][:] = turned(base[:3, :3], twist)
        return tip, jacobian
