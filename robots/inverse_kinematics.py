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


def approach(chain: SerialChain, q: Vector, position: Vector, orientation: Vector, step: Vector, iterations: int) -> Vector:
    """Return joint positions, shape (n,), nearer to the goal than `q`, inside the joint ranges and at most `step` away from `q`.

    Args:
        chain: the kinematics.
        q: where to start, shape (n,), rad and m.
        position: goal of the tip in the base frame, m, shape (3,).
        orientation: goal of the tip in the base frame, quaternion (x, y, z, w).
        step: largest distance of each joint from `q`, shape (n,); all joints slow down together, so that the way stays straight.
        iterations: how often to correct; near the goal each one squares the error.
    """
    found = q
    for _ in range(iterations):
        frames = chain.frames(found)
        tip = frames[-1]
        turn = rotation.log(rotation.product(orientation, rotation.conjugate(rotation.from_matrix(tip))))
        error = np.concatenate([position - tip[:3, 3], _LENGTH * turn])
        jacobian = chain.jacobian(frames)
        jacobian[3:] *= _LENGTH
        normal = jacobian.T @ jacobian
        normal.flat[:: len(q) + 1] += 0.5 * error.dot(error) + _LEAST_DAMPING
        found = np.minimum(np.maximum(found + np.linalg.solve(normal, jacobian.T @ error), chain.lower), chain.upper)
    move = found - q
    share = float(np.max(np.abs(move) / step))
    return found if share <= 1.0 else q + move / share
