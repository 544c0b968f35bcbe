"""The hand with the hook: where its bare end is, and poses that bring this end to a place. SI units."""

from __future__ import annotations

import numpy as np

from controllers.cholecystectomy.approach import MARGIN, NEAR, clearance
from controllers.cholecystectomy.obstacles import Obstacles
from controllers.cholecystectomy.reach import path_margins
from controllers.cholecystectomy.surgeon_hand import SurgeonHand
from robots import rotation
from robots.dvrk.end_effectors.electrode import Electrode
from robots.dvrk.instruments import Jaw
from robots.serial_chain import SerialChain
from robots.transform import matrix_to_pose, pose_to_matrix
from schemas.errors import MotionError
from schemas.vectors import Vector

__all__ = ["HookHand"]

_DIPS = np.radians([20.0, 35.0, 50.0, 5.0, 65.0])
"""Angles of the hook's direction towards the bed, the preferred first."""
_YAWS = np.radians([0.0, 20.0, -20.0, 40.0, -40.0, 60.0, -60.0])
"""Angles of this direction about the normal of the bed, the preferred first."""
_ROOMY, _CLEAR = 0.3, 4.0e-3
"""Joint margin, and distance of shaft from tissue (m), beyond which more is no better."""

_TRAVEL = 0.3
"""What a radian of the joint that turns farthest counts against a pose."""


class HookHand(SurgeonHand):
    """An arm with a hook in place of jaws."""

    def __init__(self, arm: str, base: Vector, chain: SerialChain, electrode: Electrode, tip: Vector) -> None:
        """`tip`: pose of the tip frame in the frame of the last link, shape (4, 4)."""
        super().__init__(arm, base, chain, Jaw(0.0, 0.0, 0.0, electrode.length, 0.0))
        places = [np.array(sphere.position) - tip[:3, 3] for sphere in electrode.bare(tip)]
        bare = np.array(places) @ tip[:3, :3]
        self._middle: Vector = bare.mean(axis=0)
        """Middle of the bare end in the frame of the tip, m, shape (3,)."""
        foot = bare[-1] - bare[0]
        foot -= np.array([0.0, 0.0, float(foot[2])])
        length = float(np.linalg.norm(foot))
        self._foot = foot / length if length > 1e-6 else np.array([1.0, 0.0, 0.0])
        """Direction of the bent end in the frame of the tip, shape (3,); any of a straight end."""

    @property
    def bare_end(self) -> Vector:
        """Measured middle of the bare end, m, shape (3,)."""
        at = pose_to_matrix(self.measured)
        found: Vector = at[:3, :3] @ self._middle + at[:3, 3]
        return found

    def choose(
        self, place: Vector, ahead: Vector, normal: Vector, away: float, obstacles: Obstacles
    ) -> Vector:
        """Return the pose of the tip, shape (7,), with the bare end at a place and its foot across the way.

        Args:
            place: m, shape (3,).
            ahead: direction along the bed, shape (3,).
            normal: of the bed, away from it, shape (3,).
            away: length of the straight way to the place, m.
            obstacles: that shaft and wrist keep away from.

        Raises MotionError if the joints do not allow any.
        """
        poses = self._poses(place, ahead, normal)
        begins = poses.copy()
        begins[:, :3, 3] -= away * poses[:, :3, 2]
        margins, joints = path_margins(self, np.stack([begins, poses], axis=1))
        near = obstacles.near(place, NEAR)
        rooms = [
            clearance(self, pose[None], q[-1:], 0.0, near) for pose, q in zip(poses, joints, strict=True)
        ]
        order = np.linspace(0.0, 0.5, len(poses))
        travel = _TRAVEL * np.abs(joints[:, -1] - self.joints).max(axis=1)
        room = np.clip(np.array(rooms) / _CLEAR, -1.0, 1.0)
        good = np.minimum(margins / _ROOMY, 1.0) + room - order - travel
        score = np.where(margins < MARGIN, -np.inf, good)
        if not np.isfinite(score).any():
            x, y, z = (1e3 * place).tolist()
            raise MotionError(
                f"{self.arm} does not reach ({x:.0f}, {y:.0f}, {z:.0f}) mm with its hook: the joints have"
                f" {max(0.0, float(margins.max())):.2f} of their ranges left, {MARGIN} at least is needed"
            )
        return matrix_to_pose(poses[int(score.argmax())])

    def _poses(self, place: Vector, ahead: Vector, normal: Vector) -> Vector:
        """Return poses with the bare end at a place, shape (n, 4, 4), the preferred ones first."""
        found: list[Vector] = []
        own = np.column_stack([self._foot, np.cross([0.0, 0.0, 1.0], self._foot), [0.0, 0.0, 1.0]])
        for dip in _DIPS.tolist():
            for yaw in _YAWS.tolist():
                along = rotation.matrix(rotation.exp(yaw * normal)) @ ahead
                z = np.cos(dip) * along - np.sin(dip) * normal
                across = np.cross(normal, along)
                for foot in (across, -across):
                    pose = np.eye(4)
                    pose[:3, :3] = np.column_stack([foot, np.cross(z, foot), z]) @ own.T
                    pose[:3, 3] = place - pose[:3, :3] @ self._middle
                    found.append(pose)
        return np.array(found)
