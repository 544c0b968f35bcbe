"""Checks of a ROS message, beyond type and finite numbers, before entry into the simulation."""

from __future__ import annotations

from math import hypot

import numpy as np

from devices.ros.topics.row import Row
from schemas.crtk import CartesianImpedance, CartesianState
from schemas.errors import MessageError
from schemas.message import Message
from schemas.ports import Port
from schemas.ros import JointState, PoseStamped, Quaternion

__all__ = ["as_signal", "validate"]

_QUATERNION_TOLERANCE = 1e-3
"""Tolerance of the norm of quaternions, as for values of signals (schemas.vectors)."""


def validate(message: Message, row: Row) -> None:
    """Check the number of joints against the row's port, and the norms of quaternions.

    Raises MessageError.
    """
    if isinstance(message, JointState):
        _check_joints(message, row)
    elif isinstance(message, PoseStamped):
        _check_quaternion(message.pose.orientation)
    elif isinstance(message, Quaternion):
        _check_quaternion(message)
    elif isinstance(message, CartesianState) and message.pose_is_valid.data:
        _check_quaternion(message.pose.orientation)
    elif isinstance(message, CartesianImpedance):
        _check_quaternion(message.force_orientation)
        _check_quaternion(message.torque_orientation)


def _check_joints(message: JointState, row: Row) -> None:
    joints = 0 if row.port is None else len(row.port.names)
    main = "effort" if row.name.endswith("_jf") else "position"
    sizes = {
        "name": len(message.name),
        "position": message.position.size,
        "velocity": message.velocity.size,
        "effort": message.effort.size,
    }
    if not sizes[main]:
        raise MessageError(f"no {main} is stated" + (f", expected {joints}" if joints else ""))
    expected = joints or sizes[main]
    for part, size in sizes.items():
        if size not in (0, expected):
            raise MessageError(f"{size} values in {part}, expected {expected}")


def _check_quaternion(q: Quaternion) -> None:
    norm = hypot(q.x, q.y, q.z, q.w)
    if abs(norm - 1.0) > _QUATERNION_TOLERANCE:
        raise MessageError(
            f"quaternion (x, y, z, w) has norm {norm:.6g}, expected 1 within {_QUATERNION_TOLERANCE:g}"
        )


def as_signal(message: Message, port: Port) -> Message:
    """Return a real arm's message as the signal `port`: our joint names, zeros for missing fields."""
    if not isinstance(message, JointState):
        return message
    stated = {field: getattr(message, field) for field in port.fields}
    zeros = np.zeros(len(port.names))
    return message.model_copy(
        update={"name": list(port.names)}
        | {field: value if value.size else zeros for field, value in stated.items()}
    )
