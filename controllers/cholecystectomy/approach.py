"""Poses of open jaws across a tube, in reach, and clear of everything else. SI units, in the world."""

from __future__ import annotations

from collections.abc import Sequence
from math import radians
from typing import NamedTuple

import numpy as np

from controllers.cholecystectomy.reach import path_margins
from controllers.cholecystectomy.surgeon_hand import SurgeonHand
from controllers.expert.reach import LINK_RADII, links
from robots.dvrk.end_effectors.contact_sphere import FINGER_HALF_WIDTH, JAW_ROOT
from robots.transform import pose_to_matrix
from schemas.errors import MotionError
from schemas.vectors import Vector

__all__ = ["Obstacles", "choose_pose", "hurts", "jaw_poses", "skewed", "withdraw"]

MARGIN = 0.06
"""Least share of each joint's range, from its middle to its end, that stays free."""
_ROOMY, _CLEAR = 0.3, 4.0e-3
"""Margin, and distance from obstacles (m), beyond which more is no better."""
_TOUCHING = 1.0e-3
"""Distance from nodes of an organ within which an instrument may touch the faces between, m."""
_FACE = 2.0e-3
"""Distance from nodes of an organ within which blades may close on the faces between, m."""
_WAY = np.array([1.0, 0.5, 0.2, 0.0])
"""Checked parts of the straight way to a goal, from its beginning."""
_ALONE = 2.0e-3
"""Distance of other tissue from the space between the jaws beyond which more is no better, m."""
_HALF_CLIP, _HALF_GAP = 1.0e-3, 2.5e-3
"""Half the size of that space along the tube, and from jaw to jaw, m."""
_NEAR = 0.06
"""Obstacles farther from the goal do not count, m."""
_TILTS = np.radians(np.arange(-75.0, 76.0, 15.0))
"""Angles about the tube, from the direction in which the shaft comes."""
_SKEW = radians(20.0)
"""Deviation from a right angle to a tube out of reach; a clip may lie 30 degrees off square."""
_SPREAD = np.linspace(0.25, 1.0, 4)
"""Points along a finger, as shares of its length."""


class Obstacles(NamedTuple):
    """Spheres that jaws and shaft keep away from."""

    points: Vector
    """m, shape (n, 3)."""
    radii: Vector
    """m, shape (n,)."""

    @staticmethod
    def join(parts: Sequence[Obstacles]) -> Obstacles:
        """Return all obstacles of several."""
        points = [np.zeros((0, 3)), *(part.points for part in parts)]
        return Obstacles(
            np.concatenate(points), np.concatenate([np.zeros(0), *(part.radii for part in parts)])
        )

    def near(self, point: Vector) -> Obstacles:
        """Return the obstacles near a point (m, shape (3,))."""
        chosen = np.linalg.norm(self.points - point, axis=1) < _NEAR
        return Obstacles(self.points[chosen], self.radii[chosen])


def withdraw(pose: Vector, away: float) -> Vector:
    """Return a pose, shape (7,), moved so far (m) against the direction of the jaw."""
    moved = pose.copy()
    moved[:3] -= away * pose_to_matrix(pose)[:3, 2]
    return moved


def jaw_poses(hand: SurgeonHand, point: Vector, along: Vector, bite: float) -> Vector:
    """Return poses of a tip, shape (n, 4, 4), with a tube between the jaws at a right angle.

    Args:
        hand: the arm.
        point: middle of the tube between the jaws, m, shape (3,).
        along: direction of the tube, shape (3,).
        bite: distance of the tube from the hinge, m.
    """
    ahead = point - hand.base[:3, 3]
    ahead -= (ahead @ along) * along
    ahead /= max(float(np.linalg.norm(ahead)), 1e-9)
    side = np.cross(along, ahead)
    poses: list[Vector] = []
    for tilt in _TILTS.tolist():
        z = np.cos(tilt) * ahead + np.sin(tilt) * side
        for x in (along, -along):
            pose = np.eye(4)
            pose[:3, :3] = np.column_stack([x, np.cross(z, x), z])
            pose[:3, 3] = point - bite * z
            poses.append(pose)
    return np.array(poses)


def skewed(along: Vector) -> Vector:
    """Return directions around that of a tube, shape (3,), as if it lay askew, shape (4, 3)."""
    across = np.eye(3)[int(np.abs(along).argmin())]
    across -= (across @ along) * along
    across /= np.linalg.norm(across)
    sides = np.stack([across, np.cross(along, across)])
    return np.cos(_SKEW) * along + np.sin(_SKEW) * np.concatenate([sides, -sides])


def choose_pose(
    hand: SurgeonHand,
    poses: Vector,
    away: float,
    opening: float,
    obstacles: Obstacles,
    what: str,
    spared: Obstacles | None = None,
) -> Vector:
    """Return the best of `poses`, shape (4, 4), by joint margins and distance from obstacles.

    Raises MotionError if the joints do not allow any, or if all would hurt what is spared.

    Args:
        hand: the arm.
        poses: goals of the tip, shape (n, 4, 4), the preferred ones in the middle.
        away: length of the straight way to the goal, m.
        opening: of the jaw on that way, rad.
        obstacles: in the neighbourhood.
        what: the goal, for the message.
        spared: what blades must not touch; None for other jaws.
    """
    ways = np.repeat(poses[:, None], len(_WAY), axis=1)
    ways[:, :, :3, 3] -= away * _WAY[:, None] * poses[:, None, :3, 2]
    margins, joints = path_margins(hand, ways)
    if margins.max() < MARGIN:
        x, y, z = (1e3 * poses[int(margins.argmax()), :3, 3]).tolist()
        raise MotionError(
            f"{hand.arm} does not reach {what}: with the tip at ({x:.0f}, {y:.0f}, {z:.0f}) mm the joints"
            f" have {max(0.0, float(margins.max())):.2f} of their ranges left, {MARGIN} at least is needed"
        )
    clearances = _clearances(hand, ways, joints, opening, obstacles)
    gaps = np.array([gap_between(hand, pose, obstacles) for pose in poses])
    turns = np.abs(np.linspace(-1.0, 1.0, len(poses)))
    travel = np.abs(joints[:, 0] - hand.joints).max(axis=1)
    score = (
        np.minimum(margins / _ROOMY, 1.0)
        + np.clip(clearances / _CLEAR, -0.5, 1.0)
        + np.clip(clearances / _TOUCHING - 1.0, -2.0, 0.0)
        + np.clip(gaps / _ALONE, -2.0, 1.0)
        - 0.3 * turns
        - 0.1 * travel
    )
    refused = margins < MARGIN
    if spared is not None:
        refused |= _clearances(hand, ways, joints, opening, spared) < 0.0
        refused |= np.array([hurts(hand, pose, spared) for pose in poses])
    if refused.all():
        raise MotionError(f"{hand.arm} does not reach {what} without touching an organ to be spared")
    return poses[int(np.where(refused, -np.inf, score).argmax())]


def _clearances(
    hand: SurgeonHand, ways: Vector, joints: Vector, opening: float, obstacles: Obstacles
) -> Vector:
    """Return the least clearance of each way, shape (n,)."""
    return np.array(
        [
            min(clearance(hand, pose, q, opening, obstacles) for pose, q in zip(way, angles, strict=True))
            for way, angles in zip(ways, joints, strict=True)
        ]
    )


def hurts(hand: SurgeonHand, pose: Vector, spared: Obstacles) -> bool:
    """Whether closing blades at a pose, shape (4, 4), would meet an organ to be spared."""
    return gap_between(hand, pose, spared) <= _FACE


def gap_between(hand: SurgeonHand, pose: Vector, obstacles: Obstacles) -> float:
    """Return the distance of the nearest obstacle from the space between the closing jaws, m."""
    local = (obstacles.points - pose[:3, 3]) @ pose[:3, :3]
    nearest = np.clip(local, [-_HALF_CLIP, -_HALF_GAP, JAW_ROOT], [_HALF_CLIP, _HALF_GAP, hand.jaw.length])
    return float((np.linalg.norm(local - nearest, axis=1) - obstacles.radii).min(initial=np.inf))


def clearance(hand: SurgeonHand, pose: Vector, joints: Vector, opening: float, obstacles: Obstacles) -> float:
    """Return the distance of an instrument with open jaws from the nearest obstacle, m."""
    if not len(obstacles.points):
        return _CLEAR
    half = 0.5 * opening + radians(5.0)
    ways = hand.jaw.length * _SPREAD[:, None]
    fingers = [
        pose[:3, 3] + ways * (np.cos(half) * pose[:3, 2] + side * np.sin(half) * pose[:3, 1])
        for side in (1.0, -1.0)
    ]
    body = links(hand.chain, hand.base, joints[None])[0]
    points = np.concatenate([*fingers, body])
    radii = np.concatenate([np.full(2 * len(ways), FINGER_HALF_WIDTH), LINK_RADII])
    apart = np.linalg.norm(points[:, None] - obstacles.points, axis=2) - radii[:, None] - obstacles.radii
    return float(apart.min())
