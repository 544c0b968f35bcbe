"""Fingers from a file of `trocar instruments import`: their surfaces, and boxes to grasp with."""

from __future__ import annotations

import numpy as np

from engines.mujoco.looks.fingers import ROOT, finger_frame
from engines.mujoco.looks.part import STEEL, Collisions, Looks, Part, Primitive
from robots.dvrk.end_effectors.end_effector import Mount
from robots.dvrk.end_effectors.jaw import FINGERS
from robots.dvrk.end_effectors.own_jaw import Finger, OwnJaw
from schemas.vectors import Vector

__all__ = ["collision", "parts"]

_PAD = 0.4
"""Part of the length where the pad of a finger begins."""


def parts(jaw: OwnJaw, _instrument: str, mount: Mount) -> Looks:
    """Return the surfaces of both fingers."""
    pose = finger_frame(mount)
    looks: dict[str, tuple[Part, ...]] = {}
    for name, finger in zip(FINGERS, (jaw.left, jaw.right), strict=True):
        vertices, faces = finger.triangles
        looks[name] = (Part(name, vertices @ pose[:3, :3].T + pose[:3, 3], faces, STEEL),)
    return looks


def collision(jaw: OwnJaw, _instrument: str, mount: Mount) -> Collisions:
    """Return the boxes of both fingers, each with a face in the plane between them."""
    pose = finger_frame(mount)
    sides = zip(FINGERS, (jaw.left, jaw.right), (1.0, -1.0), strict=True)
    return {name: (_box(name, jaw, finger, side, pose),) for name, finger, side in sides}


def _box(name: str, jaw: OwnJaw, finger: Finger, side: float, pose: Vector) -> Primitive:
    """Return the box of a finger: side 1 (left) or -1 (right), in the frame `pose`, shape (4, 4)."""
    vertices = finger.triangles[0]
    pad = vertices[vertices[:, 2] > _PAD * jaw.length]
    thickness = float(np.median(np.maximum(side * pad[:, 0], 2e-4)))
    low, high = pad[:, 1].min(), pad[:, 1].max()
    box = pose.copy()
    box[:3, 3] += pose[:3, :3] @ (side * thickness / 2.0, (low + high) / 2.0, (ROOT + jaw.length) / 2.0)
    return Primitive(name, "box", (thickness / 2.0, (high - low) / 2.0, (jaw.length - ROOT) / 2.0), box)
