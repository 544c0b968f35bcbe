"""Joint-space dynamics of an arm: inertia matrix and gravity.

They follow from its kinematics, its linkage and the masses of its bodies.

Every body moves as a rigid displacement D(q) from where it is with every joint at 0. With the pseudo-inertia
J of the body (integral of r r^T over its mass, r homogeneous, in the base frame there) the inertia matrix is
M_ij = sum trace(D_i J D_j^T) and the effort of gravity G_i = -sum g^T D_i J e4, D_i being the derivative by
q_i (Uicker's form of Lagrange's equations; Siciliano et al., Robotics, section 7.1). The linkage's bodies
follow the joints, so that all is a function of the independent joints.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from robots.dvrk import arm_bodies, drives, ecm, linkage, psm
from robots.dvrk.inertia import Inertia
from robots.dvrk.instruments import Instrument
from robots.dvrk.linkage import Linkage
from robots.serial_chain import SerialChain
from schemas.vectors import Vector

__all__ = ["STANDARD_GRAVITY", "Dynamics", "of_ecm", "of_psm"]

STANDARD_GRAVITY = 9.81
"""m/s^2, as in the identified model and the real controller's gravity compensation."""

_UNMOVED = np.eye(4)
_DOWN = np.array([0.0, 0.0, -STANDARD_GRAVITY])
_INSTANT = 1e-4
"""s, of the central difference along the motion: its error is below 1e-8 of the velocity's square."""


class _Motion(NamedTuple):
    """Motion of a body against its parent: `ratio` times `joint` along `twist`, (4, 4), base frame, q = 0."""

    parent: int
    joint: int
    ratio: float
    twist: Vector
    is_revolute: bool


class Dynamics:
    """The dynamics of one arm over its n independent joints."""

    def __init__(
        self, chain: SerialChain, bars: Linkage, bodies: Mapping[str, Inertia], rotors: Vector
    ) -> None:
        """`rotors`: inertia of the drives at the joints, shape (n,).

        A body beside joints and linkage (a finger of the jaw) moves with the last link.
        """
        self._chain, self._joints = chain, len(chain.joints)
        self._rotors = np.diag(rotors)
        index = {joint.name: i for i, joint in enumerate(chain.joints)}
        self._motions = [_Motion(i - 1, i, 1.0, *_joint_twist(chain, i)) for i in range(self._joints)]
        for passive in bars.joints:
            leader, parent = index[passive.follows], index[passive.parent]
            is_revolute = chain.joints[leader].kind == "revolute"
            axis = linkage.PITCH_AXIS if is_revolute else linkage.INSERTION_AXIS
            twist = _twist(np.array(axis), np.array(passive.pivot), is_revolute)
            index[passive.name] = len(self._motions)
            self._motions.append(_Motion(parent, leader, passive.ratio, twist, is_revolute))
        self._ratios = np.array([motion.ratio for motion in self._motions])
        self._leaders = np.array([motion.joint for motion in self._motions])
        self._turning = np.array([motion.is_revolute for motion in self._motions])
        self._twists = np.array([motion.twist for motion in self._motions])  # (motions, 4, 4)
        self._moved_by = [index.get(name, self._joints - 1) for name in bodies]
        self._pseudo = np.array([body.pseudo_inertia for body in bodies.values()])  # (bodies, 4, 4)

    def displacements(self, q: Vector) -> Vector:
        """Return the derivatives of the bodies' displacements by the joints, shape (..., bodies, n, 4, 4).

        Those of one configuration `q`, shape (n,), or of many, shape (N, n). The bodies are in the order in
        which they were given.

        Raises MotionError if `q` is not n finite numbers for every configuration.
        """
        self._chain.check_form(q)
        ways = (self._ratios * q.take(self._leaders, -1)).T  # (motions, ...)
        steps, twists, ratios = self._twist_exponentials(ways), self._over(self._twists, ways), self._ratios
        above, poses = np.empty_like(steps), np.empty_like(steps)
        for i, (parent, *_) in enumerate(self._motions):
            above[i] = poses[parent] if parent >= 0 else _UNMOVED
            np.matmul(above[i], steps[i], out=poses[i])
        own = (self._over(ratios, ways)[..., None, None] * above) @ twists @ steps
        slopes = np.zeros((len(steps), self._joints, *steps.shape[1:]))
        for i, (parent, joint, *_) in enumerate(self._motions):
            if parent >= 0:
                np.matmul(slopes[parent], steps[i], out=slopes[i])
            slopes[i, joint] += own[i]
        return np.moveaxis(slopes[self._moved_by], (0, 1), (-4, -3))

    def effort_gradients(
        self, q: Vector, dq: Vector, ddq: Vector, acceleration: Vector | None = None
    ) -> Vector:
        """Return the derivatives of the joints' efforts by the bodies' pseudo-inertias.

        The effort of motion and gravity is linear in the pseudo-inertias J of the bodies: effort_i = sum_b
        trace(Y_ib^T J_b) with Y_ib = D_i^T A, A = sum_j D_j ddq_j + V' - (gravity, on e4). V' is the
        derivative of V(q) = sum_j D_j dq_j along the motion, a central difference.

        Args:
            q: joint positions, rad and m, shape (n,) or (N, n).
            dq: joint velocities, rad/s and m/s, same shape.
            ddq: joint accelerations, rad/s^2 and m/s^2, same shape.
            acceleration: of gravity, as of `gravity`.

        Returns:
            Shape (..., n, bodies, 4, 4), symmetric, the bodies in the order in which they were given.

        Raises MotionError if `q` is not n finite numbers for every configuration.
        """
        slopes = self.displacements(q)
        moved = _along(slopes, ddq)
        for way in (1.0, -1.0):
            beside = self.displacements(q + way * _INSTANT * dq)
            moved += way / (2.0 * _INSTANT) * _along(beside, dq)
        moved[..., :3, 3] -= _DOWN if acceleration is None else acceleration
        gradients = np.moveaxis(slopes.swapaxes(-1, -2) @ moved[..., None, :, :], -4, -3)
        return (gradients + gradients.swapaxes(-1, -2)) / 2.0

    @staticmethod
    def _over(values: Vector, ways: Vector) -> Vector:
        """Return `values`, one for each motion, such that they go with `ways`, shape (motions, ...)."""
        return values if ways.ndim == 1 else values[:, None]

    def _twist_exponentials(self, ways: Vector) -> Vector:
        """Return exp(w T), shape (motions, ..., 4, 4), for the twist T and the ways w of each motion.

        For a rotation it is 1 + sin w T + (1 - cos w) T^2 (Rodrigues), for a translation 1 + w T.
        """
        turning, twists = self._over(self._turning, ways), self._over(self._twists, ways)
        once = np.where(turning, np.sin(ways), ways)[..., None, None]
        twice = np.where(turning, 1.0 - np.cos(ways), 0.0)[..., None, None]
        return _UNMOVED + once * twists + twice * twists @ twists

    def inertia_matrix(self, q: Vector) -> Vector:
        """Return the joint-space inertia matrix at `q`, shape (n, n): kg m^2, kg m, kg."""
        slopes = self.displacements(q)
        return np.einsum("biac,bcd,bjad->ij", slopes, self._pseudo, slopes) + self._rotors

    def gravity(self, q: Vector, acceleration: Vector | None = None) -> Vector:
        """Return the effort (N m, N) that holds the arm at `q` against gravity, shape (n,).

        Args:
            q: joint positions, shape (n,).
            acceleration: of gravity in the base frame, m/s^2, shape (3,); along -z, for an upright base,
            unless given. On a base
                turned by R against the world it is R^T (0, 0, -9.81).
        """
        pull = _DOWN if acceleration is None else acceleration
        return -np.einsum("a,biac,bc->i", pull, self.displacements(q)[..., :3, :], self._pseudo[..., 3])


def of_psm(tool: Instrument) -> Dynamics:
    """Return the dynamics of a PSM with `tool`, its jaw closed."""
    chain = psm.chain(tool)
    rotors = [drives.psm(tool)[joint.name].armature for joint in chain.joints]
    return Dynamics(chain, linkage.PSM, arm_bodies.psm(tool), np.array(rotors))


def of_ecm(endoscope_mass: float = arm_bodies.ENDOSCOPE_MASS["Classic_SD"]) -> Dynamics:
    """Return the dynamics of the ECM with an endoscope of this mass (kg)."""
    chain = ecm.chain()
    rotors = [drives.ECM[joint.name].armature for joint in chain.joints]
    return Dynamics(chain, linkage.ECM, arm_bodies.ecm(endoscope_mass), np.array(rotors))


def _along(slopes: Vector, rates: Vector) -> Vector:
    """Return sum_i D_i r_i, shape (..., bodies, 4, 4), of D, (..., bodies, n, 4, 4), and r, (..., n)."""
    flat = slopes.reshape(*slopes.shape[:-2], 16)
    return (rates[..., None, None, :] @ flat).reshape(*slopes.shape[:-3], 4, 4)


def _joint_twist(chain: SerialChain, i: int) -> tuple[Vector, bool]:
    frame = chain.frames(np.zeros(len(chain.joints)))[i]
    is_revolute = chain.joints[i].kind == "revolute"
    return _twist(frame[:3, 2], frame[:3, 3], is_revolute), is_revolute


def _twist(axis: Vector, point: Vector, is_revolute: bool) -> Vector:
    result = np.zeros((4, 4))
    if is_revolute:
        x, y, z = axis
        result[:3, :3] = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
        result[:3, 3] = -result[:3, :3] @ point
    else:
        result[:3, 3] = axis
    return result
