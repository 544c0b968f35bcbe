"""Poses of open jaws at the gallbladder's infundibulum, from its nodes. SI units, in the world."""

from __future__ import annotations

from math import radians

import numpy as np

from controllers.cholecystectomy.surgeon_hand import SurgeonHand
from robots import rotation
from schemas.errors import MotionError
from schemas.vectors import Vector

__all__ = ["grasp_poses"]

_FROM_NECK = (10.0e-3, 12.5e-3, 8.0e-3, 15.0e-3)
"""Distance of the place from the neck, by attempt, m."""
_DEPTH, _DEEPER = 6.0e-3, 2.0e-3
"""Depth of the ends of the fingers below the surface, and what each attempt adds, m."""
_COLUMN = 3.0e-3
"""Radius about the line of approach within which the surface is looked for, m."""
_TILTS = np.radians([-40.0, -20.0, 0.0, 20.0, 40.0])
_ROLLS = (-radians(30.0), 0.0, radians(30.0))


def grasp_poses(hand: SurgeonHand, nodes: Vector, neck: Vector, attempt: int) -> Vector:
    """Return poses of a tip whose open jaws stand across the gallbladder, shape (n, 4, 4).

    Raises MotionError without tissue there.

    Args:
        hand: the arm.
        nodes: of the gallbladder, m, shape (n, 3).
        neck: beginning of the cystic duct, m, shape (3,).
        attempt: number of the attempt, from 0; each goes elsewhere and deeper.
    """
    body = nodes[np.linalg.norm(nodes - neck, axis=1) < 0.03].mean(axis=0) - neck
    along = body / max(float(np.linalg.norm(body)), 1e-9)
    target = neck + _FROM_NECK[attempt % len(_FROM_NECK)] * along
    ahead = target - hand.base[:3, 3]
    ahead /= np.linalg.norm(ahead)
    across = np.cross(along, ahead)
    across /= max(float(np.linalg.norm(across)), 1e-9)
    depth = _DEPTH + _DEEPER * attempt
    poses: list[Vector] = []
    for tilt in _TILTS.tolist():
        z = rotation.matrix(rotation.exp(tilt * across)) @ ahead
        end = _surface(nodes, target, z) + depth * z
        y0 = across - (across @ z) * z
        y0 /= np.linalg.norm(y0)
        for roll in _ROLLS:
            y = rotation.matrix(rotation.exp(roll * z)) @ y0
            for side in (y, -y):
                pose = np.eye(4)
                pose[:3, :3] = np.column_stack([np.cross(side, z), side, z])
                pose[:3, 3] = end - hand.jaw.length * z
                poses.append(pose)
    return np.array(poses)


def _surface(nodes: Vector, target: Vector, ahead: Vector) -> Vector:
    """Return where a line through `target` along `ahead` meets the tissue, m, shape (3,)."""
    away = nodes - target
    depths = away @ ahead
    near = np.linalg.norm(away - depths[:, None] * ahead, axis=1) < _COLUMN
    if not near.any():
        raise MotionError("there is no tissue of the gallbladder where it is to be grasped")
    return target + depths[near].min() * ahead
