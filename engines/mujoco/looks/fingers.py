"""Fingers of jaws: shape, mesh and grasping box of each kind.

A finger is drawn with x in the opening direction of the left finger, y the wrist yaw axis, z to the tip,
origin in the axis. The pad is flat in the plane x = 0: the pads of two fingers meet when the jaw is at 0; a
curved pad (Maryland) curves along y, within the plane. Metres.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from engines.mujoco.looks.part import DARK, STEEL, Collisions, Looks, Part, Primitive
from engines.mujoco.looks.solids import block, outline, part, place_solid, plate, rod, union
from robots.dvrk.end_effectors.end_effector import Mount
from robots.dvrk.end_effectors.jaw import FINGERS, Jaw
from robots.dvrk.end_effectors.scissors import Scissors
from schemas.vectors import Vector

__all__ = ["ROOT", "Shape", "collision", "finger_frame", "fingers", "grips", "parts", "shape"]

_HUB_RADIUS, _HUB_WIDTH = 0.0025, 0.00195
"""Eye about the wrist yaw axis: a hub lies on either side of y = 0 (bounds of the jaw meshes in
med-air/SurRoL).
"""
ROOT = 0.0030
"""Distance from the axis at which the pad's plane is free of the opposite finger's hub."""


@dataclass(frozen=True)
class Shape:
    """A finger's measures; widths are halves, thicknesses whole."""

    length: float
    width: float
    tip_width: float
    thickness: float
    tip_thickness: float
    window: bool = False
    """An opening through the pad, as grasping forceps have."""
    curve: float = 0.0
    """How far the tip lies off the middle, along the yaw axis."""
    recess: float = 0.0
    """Distance of the finger behind the plane of a sliding pad."""
    offset: float = 0.0
    """Distance of a blade from the middle, along the yaw axis: blades pass each other and have no pad."""


_DRIVER = Shape(0.0, 0.00235, 0.00170, 0.0024, 0.0014)
_GRASPER = Shape(0.0, 0.00240, 0.00230, 0.0020, 0.0013, window=True)
_DISSECTOR = Shape(0.0, 0.00220, 0.00090, 0.0021, 0.0011, curve=0.0028)
_FORCEPS = Shape(0.0, 0.00220, 0.00120, 0.0020, 0.0011)
_BLADE = Shape(0.0, 0.00080, 0.00040, 0.0030, 0.0010, offset=0.00070)
_KINDS = {
    "NEEDLE": _DRIVER,
    "SUTURECUT": _DRIVER,
    "CADIERE": _GRASPER,
    "FENESTRATED": _GRASPER,
    "PROGRASP": _GRASPER,
    "BOWEL": _GRASPER,
    "MARYLAND": _DISSECTOR,
    "SCISSORS": _BLADE,
}
"""Shapes by a word in the instrument's name; widths within the jaw meshes in unina-icaros/dvrk-vrep (4.8 mm,
3.0 mm for both), forms ours.
"""


def parts(jaw: Jaw, instrument: str, mount: Mount) -> Looks:
    """Return the meshes of both fingers."""
    return fingers(shape(instrument, jaw), finger_frame(mount))


def collision(jaw: Jaw, instrument: str, mount: Mount) -> Collisions:
    """Return the boxes of both fingers."""
    return grips(shape(instrument, jaw), finger_frame(mount))


def shape(instrument: str, jaw: Jaw, recess: float = 0.0) -> Shape:
    """Return the shape of the fingers of an instrument, by name."""
    kind = next((kind for word, kind in _KINDS.items() if word in instrument), _FORCEPS)
    curve = jaw.curve if isinstance(jaw, Scissors) else kind.curve
    return replace(kind, length=jaw.length, recess=recess, curve=curve)


def finger_frame(mount: Mount) -> Vector:
    """Return the frame of drawn fingers, shape (4, 4).

    x: opening direction of the left finger; y: wrist yaw axis; z: to the tip.
    """
    pose = np.eye(4)
    pose[:3, 1], pose[:3, 2], pose[:3, 3] = mount.axis, (0.0, 0.0, -1.0), mount.pose[:3, 3]
    pose[:3, 0] = np.cross(pose[:3, 1], pose[:3, 2])
    return pose


def fingers(form: Shape, pose: Vector) -> Looks:
    """Return the meshes of two fingers in the frame `pose`, shape (4, 4)."""
    return {name: finger(name, form, side, pose) for name, side in zip(FINGERS, (1, -1), strict=True)}


def grips(form: Shape, pose: Vector) -> Collisions:
    """Return the boxes of two fingers in the frame `pose`, shape (4, 4)."""
    return {name: (grip(name, form, side, pose),) for name, side in zip(FINGERS, (1, -1), strict=True)}


def finger(name: str, form: Shape, side: int, pose: Vector) -> tuple[Part, ...]:
    """Return the meshes of a finger, side +1 (left) or -1 (right), in the frame `pose`, shape (4, 4)."""
    length, back = form.length, form.thickness
    front, tip = form.recess, form.tip_thickness
    profile = [
        (ROOT, front),
        (length, front),
        (length, 0.6 * tip),
        (length - 0.0006, tip),
        (0.45 * length, back),
        (ROOT, back),
    ]
    blade = plate("y", outline(profile), -0.01, 0.01) ^ plate(
        "x", outline(_top_view(form, ROOT / length), min(0.0004, 0.5 * form.tip_width)), -0.01, 0.01
    ).translate((0.0, -side * form.offset, 0.0))
    low, high = sorted((-side * _HUB_WIDTH, 0.0))
    hub = rod((0.0, low, 0.0), (0.0, high, 0.0), _HUB_RADIUS)
    arm = block((0.0, low, 0.0), (back, high, ROOT + 0.0012))
    pad = plate("x", outline(_top_view(form, 0.42, 0.97, share=0.8)), 0.0, 0.0002)
    if form.window:
        half, low_end, high_end = 0.45 * form.width, 0.50 * length, 0.86 * length
        hole = plate(
            "x",
            outline([(-half, low_end), (half, low_end), (half, high_end), (-half, high_end)], 0.0004),
            -0.01,
            0.01,
        )
        blade, pad = blade - hole, pad - hole
    finished = [(name, union(hub, arm, blade if form.offset else blade - pad), STEEL)] + (
        [] if form.recess or form.offset else [(f"{name}_pad", pad, DARK)]
    )
    solids = [
        (label, solid if side > 0 else solid.mirror((1.0, 0.0, 0.0)), material)
        for label, solid, material in finished
    ]
    return tuple(
        part(label, place_solid(solid, pose[:3, :3], pose[:3, 3]), material)
        for label, solid, material in solids
    )


def grip(name: str, form: Shape, side: int, pose: Vector) -> Primitive:
    """Return the collision box of a finger.

    The face is exactly the plane of the pad, or behind the plane.
    """
    centre = np.array(
        [
            side * (form.tip_thickness + form.recess) / 2.0,
            _finger_curve(form, 0.7),
            (ROOT + form.length) / 2.0,
        ]
    )
    box = pose.copy()
    box[:3, 3] += pose[:3, :3] @ centre
    return Primitive(
        name,
        "box",
        (
            (form.tip_thickness - form.recess) / 2.0,
            (form.width + form.tip_width) / 2.0,
            (form.length - ROOT) / 2.0,
        ),
        box,
    )


def _top_view(form: Shape, start: float, end: float = 1.0, share: float = 1.0) -> list[tuple[float, float]]:
    """Return the outline (y, z) of the pad's face, counter-clockwise.

    Args:
        form: of the finger.
        start: beginning, as a fraction of the length.
        end: end, as a fraction of the length.
        share: of the pad's width.
    """
    root = ROOT / form.length
    right, left = list[tuple[float, float]](), list[tuple[float, float]]()
    for s in np.linspace(start, end, 5 if form.curve else 2).tolist():
        half = share * (form.width + (form.tip_width - form.width) * (s - root) / (1.0 - root))
        right.append((_finger_curve(form, s) - half, s * form.length))
        left.append((_finger_curve(form, s) + half, s * form.length))
    return [*left, *reversed(right)]


def _finger_curve(form: Shape, s: float) -> float:
    return form.curve * s**2
