"""Kinematics of a serial chain in modified Denavit-Hartenberg form.

Link i stands to link i-1 as Rx(alpha) Tx(a) Rz(theta) Tz(d) (Craig, Introduction to Robotics, section 3.4); q is added to
theta of a revolute and to d of a prismatic joint.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, sin
from typing import Literal

import numpy as np

from schemas.vectors import Vector

__all__ = ["Joint", "SerialChain"]


@dataclass(frozen=True)
class Joint:
    """One joint: its modified DH row (rad, m) and what it can do (rad, m; rad/s, m/s; N m, N)."""

    name: str
    kind: Literal["revolute", "prismatic"]
    alpha: float
    a: float
    d: float
    theta: float
    lower: float
    upper: float
    velocity: float
    effort: float

    def transform(self, q: float) -> Vector:
        """Return the pose of this link in the link before it, shape (4, 4), at joint position `q`."""
        theta, d = (self.theta + q, self.d) if self.kind == "revolute" else (self.theta, self.d + q)
        ca, sa, ct, st = _cos(self.alpha), _sin(self.alpha), _cos(theta), _sin(theta)
        return np.array([[ct, -st, 0.0, self.a], [st * ca, ct * ca, -sa, -d * sa], [st * sa, ct * sa, ca, d * ca], [0.0, 0.0, 0.0, 1.0]])


def _cos(angle: float) -> float:
    return cos(angle) if abs(cos(angle)) > 1e-15 else 0.0  # so that right angles are exact


def _sin(angle: float) -> float:
    return sin(angle) if abs(sin(angle)) > 1e-15 else 0.0


class SerialChain:
    """Forward kinematics and geometric Jacobian of n joints and a tip fixed to the last link."""

    def __init__(self, joints: Sequence[Joint], tip: Vector) -> None:
        """Take the joints from the base outwards, and the pose of the tip in the last link's frame, shape (4, 4)."""
        self.joints = tuple(joints)
        self.tip = tip
        self.lower = np.array([joint.lower for joint in joints])  # (n,)
        self.upper = np.array([joint.upper for joint in joints])  # (n,)
        self.velocity = np.array([joint.velocity for joint in joints])  # (n,)
        self._prismatic = [i for i, joint in enumerate(joints) if joint.kind == "prismatic"]
        # A link's transform is affine in (cos q, sin q) or in q: all of them come from one multiplication.
        zero = np.array([joint.transform(0.0) for joint in joints])
        quarter = np.array([joint.transform(np.pi / 2 if joint.kind == "revolute" else 1.0) for joint in joints])
        half = np.array([joint.transform(np.pi) for joint in joints])
        revolute = np.array([joint.kind == "revolute" for joint in joints])[:, None, None]
        constant = np.where(revolute, (zero + half) / 2, zero)
        cosine = np.where(revolute, (zero - half) / 2, 0.0)
        other = quarter - constant  # factor of sin q, or of q
        self._basis = np.stack([constant, cosine, other], axis=1).reshape(len(self.joints), 3, 16)
        self._factors = np.ones((len(self.joints), 1, 3))

    def frames(self, q: Vector) -> Vector:
        """Return the poses of all links and of the tip in the base frame, shape (n + 1, 4, 4), at `q`, shape (n,)."""
        n = len(self.joints)
        factors = self._factors
        np.cos(q, out=factors[:, 0, 1])
        np.sin(q, out=factors[:, 0, 2])
        factors[self._prismatic, 0, 2] = q[self._prismatic]
        links = (self._factors @ self._basis).reshape(n, 4, 4)
        poses = np.empty((n + 1, 4, 4))
        pose = poses[0] = links[0]
        for i in range(1, n):
            pose = np.matmul(pose, links[i], out=poses[i])
        np.matmul(pose, self.tip, out=poses[n])
        return poses

    def forward(self, q: Vector) -> Vector:
        """Return the pose of the tip in the base frame, shape (4, 4)."""
        return self.frames(q)[-1]

    def jacobian(self, frames: Vector) -> Vector:
        """Return J, shape (6, n), with twist of the tip (m/s, rad/s; in the base frame) = J dq, from `frames(q)`."""
        jacobian = np.empty((6, len(self.joints)))
        zx, zy, zz = axes = frames[:-1, :3, 2].T  # (3, n)
        rx, ry, rz = frames[-1, :3, 3:] - frames[:-1, :3, 3].T  # (3, n)
        jacobian[0] = zy * rz - zz * ry
        jacobian[1] = zz * rx - zx * rz
        jacobian[2] = zx * ry - zy * rx
        jacobian[3:] = axes
        jacobian[:3, self._prismatic] = axes[:, self._prismatic]
        jacobian[3:, self._prismatic] = 0.0
        return jacobian
