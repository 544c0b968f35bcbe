"""Poses of open jaws across a tube, in reach, and clear of everything else. SI units, in the world."""

from __future__ import annotations

from math import ceil, radians

import numpy as np
from numpy.typing import NDArray

from controllers.cholecystectomy.obstacles import Obstacles
from controllers.cholecystectomy.reach import path_margins
from controllers.cholecystectomy.surgeon_hand import SurgeonHand
from controllers.expert.reach import LINK_RADII, links
from robots.dvrk.end_effectors.contact_sphere import FINGER_HALF_WIDTH, JAW_ROOT
from robots.transform import pose_to_matrix
from schemas.errors import MotionError
from schemas.vectors import Vector

__all__ = ["MARGIN", "NEAR", "choose_pose", "clearance", "hurts", "jaw_poses", "skewed", "withdraw"]

Bits = NDArray[np.bool_]

MARGIN = 0.06
"""Least share of each joint's range, from its middle to its end, that stays free."""
_ROOMY, _CLEAR = 0.3, 4.0e-3
"""Margin, and distance from obstacles (m), beyond which more is no better."""
_TOUCHING = 1.0e-3
"""Distance from obstacles below which less is worse than few joints left: tissue moves, m."""
_CUT = 1.0e-3
"""Least distance from closing blades of an organ to be spared, m: blades drag tissue along."""
_WAY = np.array([1.0, 0.5, 0.2, 0.0])
"""Checked parts of the straight way to a goal, from its beginning."""
_ALONE = 2.0e-3
"""Distance of other tissue from the space between the jaws beyond which more is no better, m."""
_HALF_CLIP, _HALF_GAP = 1.0e-3, 2.5e-3
"""Half the size of that space along the tube, and from jaw to jaw, m."""
NEAR = 0.06
"""Obstacles farther from the goal do not count, m."""
_TILTS = np.radians(np.arange(-75.0, 76.0, 15.0))
"""Angles about the tube, from the direction in which the shaft comes."""
_SKEW = radians(20.0)
"""Deviation from a right angle to a tube out of reach; a clip may lie 30 degrees off square."""
_SPREAD = np.linspace(0.25, 1.0, 4)
"""Points along a finger, as shares of its length."""


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
    uncut: Obstacles | None = None,
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
        uncut: what blades may touch, but not close on.
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
    refused = margins < MARGIN
    gaps = np.array([gap_between(hand, pose, obstacles) for pose in poses])
    if spared is not None:
        refused |= np.array([hurts(hand, pose, spared) for pose in poses])
        free = _clearances(hand, ways, joints, opening, spared, refused)
        refused |= free < 0.0
    if uncut is not None:
        refused |= np.array([hurts(hand, pose, uncut) for pose in poses])
    if refused.all():
        raise MotionError(f"{hand.arm} does not reach {what} without touching an organ to be spared")
    room = _clearances(hand, ways, joints, opening, obstacles, refused)
    turns = np.abs(np.linspace(-1.0, 1.0, len(poses)))
    travel = np.abs(joints[:, 0] - hand.joints).max(axis=1)
    score = (
        np.minimum(margins / _ROOMY, 1.0)
        + np.clip(room / _CLEAR, -0.5, 1.0)
        + np.clip(room / _TOUCHING - 1.0, -2.0, 0.0)
        + np.clip(gaps / _ALONE, -2.0, 1.0)
        - 0.3 * turns
        - 0.1 * travel
    )
    return poses[int(np.where(refused, -np.inf, score).argmax())]


def hurts(hand: SurgeonHand, pose: Vector, spared: Obstacles) -> bool:
    """Whether closing blades at a pose, shape (4, 4), would meet an organ to be spared."""
    return gap_between(hand, pose, spared) <= _CUT


def gap_between(hand: SurgeonHand, pose: Vector, obstacles: Obstacles) -> float:
    """Return the distance of the nearest obstacle from the space between the closing jaws, m."""
    far = np.linspace(JAW_ROOT, hand.jaw.length, 1 + ceil((hand.jaw.length - JAW_ROOT) / _HALF_CLIP))
    apart = np.array([-1.0, 0.0, 1.0]) * (_HALF_GAP - _HALF_CLIP)
    local = np.stack(np.broadcast_arrays(0.0, apart[:, None], far), axis=-1).reshape(-1, 3)
    points = pose[:3, 3] + local @ pose[:3, :3].T
    return float(obstacles.distances(points, _ALONE + _HALF_CLIP).min()) - _HALF_CLIP


def _clearances(
    hand: SurgeonHand, ways: Vector, joints: Vector, opening: float, obstacles: Obstacles, refused: Bits
) -> Vector:
    """Return the least distance of an instrument from obstacles on each way, m, shape (n,).

    Args:
        hand: the arm.
        ways: poses of the tip, shape (n, poses, 4, 4).
        joints: of these poses, shape (n, poses, 6).
        opening: of the jaw, rad.
        obstacles: in the neighbourhood.
        refused: ways that are not measured, shape (n,); their clearance is that of no obstacle.
    """
    found: Vector = np.full(len(ways), _CLEAR)
    for k in np.flatnonzero(~refused).tolist():
        found[k] = clearance(hand, ways[k], joints[k], opening, obstacles)
    return found


def clearance(
    hand: SurgeonHand, poses: Vector, joints: Vector, opening: float, obstacles: Obstacles
) -> float:
    """Return the least distance of an instrument from obstacles at some poses, 4 mm at most, in m.

    Args:
        hand: the arm.
        poses: of the tip, shape (n, 4, 4).
        joints: at these poses, shape (n, 6).
        opening: of the jaw, rad.
        obstacles: in the neighbourhood.
    """
    radii = np.concatenate([np.full(2 * len(_SPREAD), FINGER_HALF_WIDTH), LINK_RADII])
    bodies = np.concatenate([_fingers(hand, poses, opening), links(hand.chain, hand.base, joints)], axis=1)
    apart = obstacles.distances(bodies.reshape(-1, 3), _CLEAR + float(radii.max()))
    return min(_CLEAR, float((apart.reshape(len(bodies), -1) - radii).min()))


def _fingers(hand: SurgeonHand, poses: Vector, opening: float) -> Vector:
    """Return points in both fingers of an open jaw, m, shape (poses, points, 3)."""
    half = 0.5 * opening + radians(5.0)
    ahead, aside = np.cos(half) * poses[:, :3, 2], np.sin(half) * poses[:, :3, 1]
    ways = hand.jaw.length * _SPREAD[:, None]
    fingers = [poses[:, None, :3, 3] + ways * (ahead + side * aside)[:, None] for side in (1.0, -1.0)]
    return np.concatenate(fingers, axis=1)
