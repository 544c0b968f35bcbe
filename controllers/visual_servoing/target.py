"""Which blob is which point of the target, and the pose of the target.

A rectangle of equal discs looks the same after half a turn. Of the orders explained by a rigid rectangle in
front of the camera, the order nearest to the expected points is taken.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from robots.transform import rigid_transform
from schemas.vectors import Vector

__all__ = ["TargetSight", "recognise_target"]

_MISFIT = 1.5
"""px (root mean square) by which a rigid target may miss its blobs: their middles are up to 1 px off the
images of the discs' centres where they are seen aslant.
"""


@dataclass(frozen=True)
class TargetSight:
    """The target as it was recognised."""

    features: Vector
    """The images of the discs' centres, normalised, shape (4, 2), in the target's order."""
    pose: Vector
    """Pose of the target in the camera's frame, shape (4, 4)."""


def recognise_target(
    cv2: Any, blobs: Vector, intrinsics: Vector, points: Vector, radius: float, expected: Vector
) -> TargetSight | None:
    """Return which of `blobs` are the target's points; None unless four of them are.

    Args:
        cv2: OpenCV.
        blobs: shape (n, 2), px.
        intrinsics: the camera matrix K, shape (3, 3).
        points: of the target in its own frame, shape (4, 3), m, along its outline; its z axis points away
        from the camera.
        radius: of the discs around the points, m.
        expected: where they are expected, normalised, shape (4, 2).
    """
    focal, middle = intrinsics[[0, 1], [0, 1]], intrinsics[:2, 2]
    normal, misfit = (blobs - middle) / focal, _MISFIT / float(focal.mean())
    way_round = _way_round(points)
    best, least = None, np.inf
    for chosen in combinations(range(len(blobs)), 4):
        four = normal[list(chosen)]
        away = four - four.mean(axis=0)
        around = np.arctan2(away[:, 1], away[:, 0]) * way_round
        outline = four[np.argsort(around, kind="stable")]
        for first in range(4):
            order = np.roll(outline, first, axis=0)
            distance = float(((order - expected) ** 2).sum())
            if distance < least and (pose := _pose(cv2, order, points, misfit)) is not None:
                best, least = TargetSight(order, pose), distance
    return best and TargetSight(best.features - _ellipse_offsets(best.pose, points, radius), best.pose)


def _ellipse_offsets(pose: Vector, points: Vector, radius: float) -> Vector:
    """Return how far the middles of the ellipses are from the images of the discs' centres, shape (4, 2).

    A disc's dual conic diag(r^2, r^2, -1) is seen as H diag(...) H^T, whose last column is the ellipse's
    middle (Hartley and Zisserman, Multiple View Geometry, section 2.2.3 and 2.4).
    """
    plane = np.empty((len(points), 3, 3))
    plane[:, :, :2], plane[:, :, 2] = pose[:3, :2], points @ pose[:3, :3].T + pose[:3, 3]
    dual = plane @ np.diag([radius**2, radius**2, -1.0]) @ plane.swapaxes(1, 2)
    centre = plane[:, :, 2]
    return dual[:, :2, 2] / dual[:, 2:, 2] - centre[:, :2] / centre[:, 2:]


def _way_round(points: Vector) -> float:
    """Return 1 if `points`, shape (4, 3), go from x to y, else -1: as their images do, since z goes away."""
    after = np.roll(points, -1, axis=0)
    return float(np.sign((points[:, 0] * after[:, 1] - points[:, 1] * after[:, 0]).sum()))


def _pose(cv2: Any, features: Vector, points: Vector, misfit: float) -> Vector | None:
    """Return the target's pose, shape (4, 4); None if no pose in front of the camera fits."""
    works, turn, shift = cv2.solvePnP(points, features, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE)
    if not works:
        return None
    turn, shift = cv2.solvePnPRefineLM(points, features, np.eye(3), None, turn, shift)
    pose = rigid_transform(cv2.Rodrigues(turn)[0], shift.ravel())
    seen = points @ pose[:3, :3].T + pose[:3, 3]
    if not np.isfinite(pose).all() or (seen[:, 2] <= 0.0).any():
        return None
    missed = seen[:, :2] / seen[:, 2:] - features
    return pose if np.sqrt((missed**2).sum(axis=1).mean()) <= misfit else None
