"""The velocity law: the twist of the tip in the tip's frame equals the twist of the hand in the hand's frame.

After Ferro et al., "A Portable da Vinci Simulator in Virtual Reality", IEEE International Conference on
Robotic Computing, 2019: with v_G the twist of the gripper in its own frame and J_G the Jacobian there, dq/dt
= J_G^-1 v_G.

Near a singularity the inverse is damped: dq = J' (J J' + l^2 I)^-1 v with l^2 = (1 - (sigma / epsilon)^2)
l_max^2 where the smallest singular value sigma is below epsilon, and l = 0 elsewhere (Chiaverini, Siciliano
and Egeland, "Review of the damped least-squares inverse kinematics with experiments on an industrial robot
manipulator", IEEE Transactions on Control Systems Technology 2(2), 1994).
"""

from __future__ import annotations

import numpy as np

from robots import rotation
from robots.serial_chain import SerialChain
from schemas.vectors import Vector

__all__ = ["advance", "joint_velocities", "twist_in_tip"]

_LENGTH = 0.1
"""Weighs orientation against position: 1 rad counts as much as 0.1 m, as in `robots.inverse_kinematics`."""
_WEIGHTS = np.array([1.0, 1.0, 1.0, _LENGTH, _LENGTH, _LENGTH])
_EPSILON = _LARGEST_DAMPING = 0.004
"""Threshold epsilon and largest damping of the weighted Jacobian, m; ours: a tip creeping at 6 mm/s in the
worst direction takes pitch and yaw to their 90 degrees a second. In 9 % of configurations drawn from a PSM's
ranges sigma is smaller, near the remote centre and at wrists bent by nearly right angles; at home sigma is
0.061.
"""


def twist_in_tip(hand: Vector, twist: Vector, scale: float) -> Vector:
    """Return the twist (6,) of the tip in the tip's frame, m/s and rad/s.

    Args:
        hand: orientation of the hand in the hand's base frame, quaternion (x, y, z, w).
        twist: twist of the hand (6,) in the hand's base frame: velocity of the origin, then angular velocity.
        scale: metres of the tip per metre of the hand.
    """
    to_hand = rotation.matrix(hand / np.linalg.norm(hand)).T
    return np.concatenate([scale * (to_hand @ twist[:3]), to_hand @ twist[3:]])


def joint_velocities(jacobian: Vector, twist: Vector) -> Vector:
    """Return dq/dt, shape (n,), for the twist (6,) of the tip and the Jacobian (6, n), in the tip's frame."""
    u, sigma, vt = np.linalg.svd(_WEIGHTS[:, None] * jacobian, full_matrices=False)
    damping = max(0.0, 1.0 - (float(sigma[-1]) / _EPSILON) ** 2) * _LARGEST_DAMPING**2
    return vt.T @ (sigma / (sigma**2 + damping) * (u.T @ (_WEIGHTS * twist)))


def advance(chain: SerialChain, q: Vector, twist: Vector, h: float) -> Vector:
    """Return the joint positions, shape (n,), after `h` seconds with the twist (6,) in the tip's frame.

    Joints about to leave their range stop at its end, and the remaining joints correct as far as possible;
    all slow down together to respect every velocity limit. Lost motion is not made up for later.
    """
    jacobian = chain.jacobian(chain.frames(q), frame="tip")
    least, most = (chain.lower - q) / h, (chain.upper - q) / h
    velocities = joint_velocities(jacobian, twist)
    free = np.ones(len(q), dtype=bool)
    while (outside := free & ((velocities < least) | (velocities > most))).any():
        free &= ~outside
        velocities[outside] = np.where(velocities < least, least, most)[outside]
        if free.any():
            velocities[free] = joint_velocities(
                jacobian[:, free], twist - jacobian[:, ~free] @ velocities[~free]
            )
    velocities /= max(1.0, float(np.abs(velocities / chain.velocity).max()))
    return np.minimum(np.maximum(q + h * velocities, chain.lower), chain.upper)
