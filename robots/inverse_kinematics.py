"""Inverse kinematics of a serial chain by damped least squares on the pose error.

Levenberg-Marquardt after Sugihara, "Solvability-Unconcerned Inverse Kinematics by the Levenberg-Marquardt Method", IEEE
Transactions on Robotics 27(5), 2011: the damping falls with the squared error, so that a reachable goal is met quadratically
and an unreachable one approached without chatter.
"""

from __future__ import annotations

import numpy as np

from robots import rotation
from robots.serial_chain import SerialChain
from schemas.vectors import Vector

__all__ = ["approach"]

_LENGTH = 0.1
"""Weighs orientation against position: 1 rad counts as much as 0.1 m, about what the tip's distance from the RCM makes of it."""
_LEAST_DAMPING = 1e-12
"""Of the normal equations (m^2): below any singular value of the weighted Jacobian at which a joint still moves the tip by a micrometre."""


def approach(chain: SerialChain, q: Vector, position: Vector, orientation: Vector, largest_move: Vector) -> Vector:
    """Return joint positions, shape (n,), nearer to the goal than `q`, inside the joint ranges and at most `largest_move` away.

    One correction: near the goal it squares the error, so calling it at every step of a control loop follows a moving
    goal (20 um a step: to some nanometres), and calling it again and again solves for one that stands.

    Args:
        chain: the kinematics.
        q: where to start, shape (n,), rad and m.
        position: goal of the tip in the base frame, m, shape (3,).
        orientation: goal of the tip in the base frame, quaternion (x, y, z, w).
        largest_move: of each joint, shape (n,); all joints slow down together, so that the way stays straight.
    """
    frames = chain.frames(q)
    tip = frames[-1]
    error = np.empty(6)
    error[:3] = position - tip[:3, 3]
    error[3:] = _LENGTH * rotation.log(rotation.product(orientation, rotation.conjugate(rotation.from_matrix(tip))))
    jacobian = chain.jacobian(frames)
    jacobian[3:] *= _LENGTH
    normal = jacobian.T @ jacobian
    normal.reshape(-1)[:: len(q) + 1] += 0.5 * error.dot(error) + _LEAST_DAMPING
    move = np.minimum(np.maximum(q + np.linalg.solve(normal, jacobian.T @ error), chain.lower), chain.upper) - q
    return q + move / max(1.0, float(np.abs(move / largest_move).max()))
