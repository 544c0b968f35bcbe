"""Rolling jaw: fingers with pads before them, and the boxes for contact.

The pads are drawn like fingers (`engines.mujoco.looks.fingers`), at the middle of their travel.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from engines.mujoco.looks.fingers import Shape, finger_frame, fingers, grips, shape
from engines.mujoco.looks.part import DARK, Collisions, Looks, Primitive
from engines.mujoco.looks.solids import block, part, place_solid
from robots.dvrk.end_effectors.end_effector import Mount
from robots.dvrk.end_effectors.rolling_jaw import PADS, RollingJaw
from schemas.vectors import Vector

__all__ = ["collision", "parts"]


def parts(jaw: RollingJaw, instrument: str, mount: Mount) -> Looks:
    """Return the meshes of fingers and pads."""
    pose = finger_frame(mount)
    looks = dict(fingers(_shape(instrument, jaw), pose))
    for name, centre, half in _pad_boxes(jaw):
        solid = block(tuple((centre - half).tolist()), tuple((centre + half).tolist()))
        looks[name] = (part(name, place_solid(solid, pose[:3, :3], pose[:3, 3]), DARK),)
    return looks


def collision(jaw: RollingJaw, instrument: str, mount: Mount) -> Collisions:
    """Return the boxes of fingers and pads: the face of a pad lies in the plane x = 0."""
    pose = finger_frame(mount)
    boxes = dict(grips(_shape(instrument, jaw), pose))
    for name, centre, half in _pad_boxes(jaw):
        box = pose.copy()
        box[:3, 3] += pose[:3, :3] @ centre
        boxes[name] = (Primitive(name, "box", tuple(half.tolist()), box),)
    return boxes


def _shape(instrument: str, jaw: RollingJaw) -> Shape:
    return shape(instrument, jaw, recess=jaw.size[2])


def _pad_boxes(jaw: RollingJaw) -> Iterator[tuple[str, Vector, Vector]]:
    """Yield name, centre and half extents (m) of each pad."""
    along, across, thickness = jaw.size
    for name, side in zip(PADS, (1, -1), strict=True):
        yield (
            name,
            np.array([side * thickness / 2.0, 0.0, jaw.distance]),
            np.array([thickness, across, along]) / 2.0,
        )
