"""The laws of image-based visual servoing with an endoscope of four joints; no ports, no pictures.

Features are points of the picture in normalised coordinates (x right, y down, at depth 1). With e their
distance from where they should be, L their interaction matrix, and J the camera's Jacobian in its own frame:

    direct    dq/dt = -gain (L J)+ e, or the nearest to it, in the picture, that the limits allow
    twist     v = -gain L+ e, dq/dt = J+ v: the classical law, which first decides how the camera should move
              (Chaumette and Hutchinson, Visual servo control part I, IEEE Robotics and Automation Magazine
              13(4), 2006, equations 4 to 11)

Four joints cannot give the camera any twist. Where a goal is out of their reach, the direct law comes to rest
where |e| is least: there (L J)^T e = 0. The classical law comes to rest elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, cast

import numpy as np

from controllers.visual_servoing.least_squares import solve_constrained
from schemas.vectors import Vector

__all__ = ["Law", "MotionLimits", "camera_twist", "interaction_matrix", "joint_velocities"]

Law = Literal["direct", "twist"]

_DAMPING = 1e-5
"""Weight of a joint velocity, in units of the features, for full rank of the system without that of L J."""


@dataclass(frozen=True)
class MotionLimits:
    """What a motion keeps."""

    lower: Vector
    """Lower joint limits, rad and m, shape (n,)."""
    upper: Vector
    velocity: Vector
    """rad/s and m/s, shape (n,)."""
    view: Vector
    """Least x and y, then largest x and y, that a feature may have, shape (2, 2)."""
    approach: float
    """1/s: nothing comes nearer to its limit than by this share of the way left in a second."""


def interaction_matrix(features: Vector, depths: Vector) -> Vector:
    """Return L, shape (2 n, 6): velocities of `features`, shape (n, 2), by the camera's twist in its frame.

    The twist is velocity (m/s), then angular velocity (rad/s); `depths`, shape (n,), m, are along the axis.
    """
    x, y = features.T
    z = 1.0 / depths
    rows = np.zeros((len(features), 2, 6))
    rows[:, 0] = np.stack([-z, 0.0 * z, x * z, x * y, -1.0 - x * x, y], axis=1)
    rows[:, 1] = np.stack([0.0 * z, -z, y * z, 1.0 + y * y, -x * y, -x], axis=1)
    return rows.reshape(-1, 6)


def camera_twist(features: Vector, goal: Vector, depths: Vector, gain: float) -> Vector:
    """Return the camera's twist, shape (6,), in its own frame, by the classical law."""
    error = (features - goal).reshape(-1)
    solution = np.linalg.lstsq(interaction_matrix(features, depths), error, rcond=None)[0]
    return -gain * cast("Vector", solution)


def joint_velocities(
    law: Law,
    q: Vector,
    jacobian: Vector,
    features: Vector,
    goal: Vector,
    depths: Vector,
    gain: float,
    limits: MotionLimits,
) -> Vector:
    """Return dq/dt, shape (n,), rad/s and m/s, within all limits.

    Args:
        law: which of the two.
        q: joint positions, shape (n,).
        jacobian: of the camera in its own frame, shape (6, n).
        features: where the points are, shape (m, 2).
        goal: where they should be, shape (m, 2).
        depths: of the points, shape (m,), m.
        gain: 1/s.
        limits: what is kept.
    """
    moved = interaction_matrix(features, depths) @ jacobian  # (2 m, n)
    rows, room = _velocity_constraints(q, moved, features, limits)
    if law == "direct":
        wanted = -gain * (features - goal).reshape(-1)
        joints = len(q)
        system = np.vstack([moved, _DAMPING * np.eye(joints)])
        velocities = solve_constrained(system, np.concatenate([wanted, np.zeros(joints)]), rows, room)
    else:
        by_twist = camera_twist(features, goal, depths, gain)
        unlimited = np.linalg.lstsq(jacobian, by_twist, rcond=None)[0]
        velocities = solve_constrained(np.eye(len(q)), cast("Vector", unlimited), rows, room)
    return velocities / max(1.0, float(abs(velocities / limits.velocity).max()))


def _velocity_constraints(
    q: Vector, moved: Vector, features: Vector, limits: MotionLimits
) -> tuple[Vector, Vector]:
    """Return rows and bounds, shapes (k, n) and (k,), of what dq/dt must keep: joint ranges and the view.

    What is outside already may not go farther out; no bound is below 0.
    """
    joints = np.eye(len(q))
    low, high = limits.view
    rows = np.vstack([joints, -joints, moved, -moved])
    left = np.concatenate(
        [limits.upper - q, q - limits.lower, (high - features).reshape(-1), (features - low).reshape(-1)]
    )
    return rows, limits.approach * np.maximum(left, 0.0)
