"""Values that a program reads from an arm or a camera. SI units, radians, quaternions (x, y, z, w)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robots.transform import matrix_to_pose, pose_to_matrix
from schemas import ros
from schemas.vectors import Vector

__all__ = ["Joints", "Picture", "Pose", "Twist", "Wrench"]


def _seconds(header: ros.Header) -> float:
    return header.stamp.sec + 1e-9 * header.stamp.nanosec


@dataclass(frozen=True, slots=True)
class Joints:
    """State of n joints: CRTK's `_js`."""

    names: tuple[str, ...]
    position: Vector
    """Shape (n,), rad or m."""
    velocity: Vector
    """Shape (n,), rad/s or m/s; (0,): not stated."""
    effort: Vector
    """Shape (n,), N m or N; (0,): not stated."""
    stamp: float
    """Wall time of publication, s."""

    @classmethod
    def from_message(cls, message: ros.JointState) -> Joints:
        """Return the values of a message."""
        return cls(
            tuple(message.name), message.position, message.velocity, message.effort, _seconds(message.header)
        )


@dataclass(frozen=True, slots=True)
class Pose:
    """Pose of an arm's tip: CRTK's `_cp`."""

    position: Vector
    """Shape (3,), m."""
    orientation: Vector
    """Unit quaternion (x, y, z, w), shape (4,)."""
    frame: str = ""
    """Reference frame; in a command, empty: the frame of `measured_cp`."""
    stamp: float = 0.0
    """Wall time of publication, s."""

    @classmethod
    def from_message(cls, message: ros.PoseStamped) -> Pose:
        """Return the values of a message."""
        p, q = message.pose.position, message.pose.orientation
        return cls(
            np.array([p.x, p.y, p.z]),
            np.array([q.x, q.y, q.z, q.w]),
            message.header.frame_id,
            _seconds(message.header),
        )

    @classmethod
    def from_matrix(cls, matrix: Vector, frame: str = "") -> Pose:
        """Return the pose of a homogeneous matrix, shape (4, 4)."""
        pose = matrix_to_pose(np.asarray(matrix, np.float64))
        return cls(pose[:3], pose[3:], frame)

    @property
    def matrix(self) -> Vector:
        """Homogeneous matrix, shape (4, 4)."""
        return pose_to_matrix(np.concatenate([self.position, self.orientation]))


@dataclass(frozen=True, slots=True)
class Twist:
    """Velocity of an arm's tip: CRTK's `_cv`."""

    linear: Vector
    """Shape (3,), m/s."""
    angular: Vector
    """Shape (3,), rad/s."""
    frame: str
    """Reference frame."""
    stamp: float
    """Wall time of publication, s."""

    @classmethod
    def from_message(cls, message: ros.TwistStamped) -> Twist:
        """Return the values of a message."""
        twist = message.twist
        return cls(
            _vector(twist.linear), _vector(twist.angular), message.header.frame_id, _seconds(message.header)
        )


@dataclass(frozen=True, slots=True)
class Wrench:
    """Wrench at an arm's tip: CRTK's `_cf`."""

    force: Vector
    """Shape (3,), N."""
    torque: Vector
    """Shape (3,), N m."""
    frame: str
    """Reference frame; empty: the tip."""
    stamp: float
    """Wall time of publication, s."""

    @classmethod
    def from_message(cls, message: ros.WrenchStamped) -> Wrench:
        """Return the values of a message."""
        wrench = message.wrench
        return cls(
            _vector(wrench.force), _vector(wrench.torque), message.header.frame_id, _seconds(message.header)
        )


@dataclass(frozen=True, slots=True)
class Picture:
    """Picture of one camera of a stereo pair."""

    pixels: NDArray[np.uint8]
    """RGB, shape (height, width, 3), row after row from the top."""
    frame: str
    """Optical frame of the camera."""
    stamp: float
    """Wall time of publication, s."""


def _vector(message: ros.Vector3) -> Vector:
    return np.array([message.x, message.y, message.z])
