"""From CRTK's messages to goals of an arm.

An invalid message raises MotionError with the allowed values.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, isfinite
from typing import Literal

import numpy as np

from robots import rotation
from robots.limits import TOLERANCE, distinct
from robots.serial_chain import Joint, SerialChain
from schemas.errors import MotionError
from schemas.ros import JointState, Point, Pose, Quaternion, Twist, Vector3, Wrench
from schemas.vectors import Vector

__all__ = [
    "check_frame",
    "efforts",
    "frame",
    "joint_values",
    "rotation_matrix",
    "stated_velocity",
    "twist",
    "vector",
    "wrench",
]

_QUATERNION_TOLERANCE = 1e-3
"""Tolerance of a unit quaternion's norm, as for the values of signals (schemas.vectors)."""
_MOST = 1e9
"""Largest accepted number, SI units: results stay finite, and no force, gain or place is larger."""


def joint_values(
    chain: SerialChain, message: JointState, part: Literal["position", "velocity", "effort"]
) -> Vector:
    """Return positions, velocities or efforts, shape (n,), in the order of the chain.

    A message with joint names may have any order.
    """
    names = chain.names
    values: Vector = getattr(message, part)
    if values.shape != (len(names),):
        raise MotionError(f"{values.size} values of {part}, expected {len(names)}: {', '.join(names)}")
    if message.name and message.name != names:
        if sorted(message.name) != sorted(names):
            raise MotionError(f"joints {', '.join(message.name)}, expected {', '.join(names)}")
        values = values[[message.name.index(name) for name in names]]
    _check_finite(values.tolist(), part)
    return values


def stated_velocity(chain: SerialChain, message: JointState) -> Vector | None:
    """Return the velocities at a goal, shape (n,); None where none are stated, or zeros alone."""
    if not any(message.velocity.tolist()):
        return None
    return joint_values(chain, message, "velocity")


def efforts(chain: SerialChain, message: JointState) -> Vector:
    """Return the efforts, shape (n,), clamped to the limits of the drives.

    Raises MotionError for an effort beyond a limit by more than `TOLERANCE`.
    """
    values = joint_values(chain, message, "effort")
    wrong = [
        _excess_sentence(joint, value)
        for joint, value in zip(chain.joints, values.tolist(), strict=True)
        if abs(value) > joint.effort + TOLERANCE
    ]
    if wrong:
        raise MotionError("; ".join(wrong))
    return np.clip(values, -chain.effort, chain.effort)


def _excess_sentence(joint: Joint, effort: float) -> str:
    value, lower, upper = distinct(effort, -joint.effort, joint.effort)
    unit = "N m" if joint.kind == "revolute" else "N"
    return f"joint {joint.name} at {value} {unit}, allowed are {lower} .. {upper}"


def check_frame(frame_id: str, *allowed: str) -> str:
    """Return `frame_id`, or the first of `allowed` for an empty `frame_id`."""
    if frame_id and frame_id not in allowed:
        raise MotionError(f"frame '{frame_id}', allowed are {', '.join(dict.fromkeys(allowed))}")
    return frame_id or allowed[0]


def frame(pose: Pose) -> Vector:
    """Return the pose as (4, 4) matrix."""
    x, y, z = _numbers(pose.position, "position")
    first, second, third = rotation.rows(*_unit_quaternion(pose.orientation))
    return np.array([(*first, x), (*second, y), (*third, z), (0.0, 0.0, 0.0, 1.0)])


def rotation_matrix(q: Quaternion) -> Vector:
    """Return the orientation as (3, 3) matrix."""
    return np.array(rotation.rows(*_unit_quaternion(q)))


def _unit_quaternion(q: Quaternion) -> tuple[float, float, float, float]:
    """Return the quaternion (x, y, z, w) of a message with a norm of 1."""
    x, y, z, w = numbers = q.x, q.y, q.z, q.w
    _check_finite(numbers, "orientation")
    norm = hypot(x, y, z, w)
    if abs(norm - 1.0) > _QUATERNION_TOLERANCE:
        raise MotionError(
            f"quaternion (x, y, z, w) has norm {norm:.6g}, allowed is 1 within {_QUATERNION_TOLERANCE:g}"
        )
    return x / norm, y / norm, z / norm, w / norm


def twist(message: Twist) -> Vector:
    """Return velocity and angular velocity, shape (6,)."""
    return np.concatenate([vector(message.linear, "twist"), vector(message.angular, "twist")])


def wrench(message: Wrench) -> Vector:
    """Return force and torque, shape (6,)."""
    return np.concatenate([vector(message.force, "wrench"), vector(message.torque, "wrench")])


def vector(message: Point | Vector3, part: str) -> Vector:
    """Return the vector, shape (3,); `part`: name for the error about a non-finite or too large vector."""
    return np.array(_numbers(message, part))


def _numbers(message: Point | Vector3, part: str) -> tuple[float, float, float]:
    x, y, z = numbers = message.x, message.y, message.z
    _check_finite(numbers, part)
    if not -_MOST <= min(x, y, z) <= max(x, y, z) <= _MOST:
        raise MotionError(f"{part} {[x, y, z]}: allowed are numbers up to {_MOST:g}")
    return numbers


def _check_finite(values: Sequence[float], part: str) -> None:
    if not all(map(isfinite, values)):
        raise MotionError(f"{part} {[*values]}: every number must be finite")
