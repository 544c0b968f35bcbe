"""Look of the PSM's instruments: housing, shaft, wrist and end effector.

Drawn in the PSM's base frame with every joint at 0. The housing belongs to the body `insertion`, the shaft to
`roll`; each wrist link and finger to the body of the same name. Sources: shaft, wrist and jaw lengths from
`robots.dvrk.instruments`; diameters and boxes of wrist and housing from unina-icaros/dvrk-vrep and the CAD
meshes in med-air/SurRoL; forms of the fingers by the kind of instrument, ours.
"""

from __future__ import annotations

import numpy as np

from engines.mujoco.looks import end_effectors
from engines.mujoco.looks.part import BLACK, BLUE, SLATE, STEEL, Looks, Part
from engines.mujoco.looks.solids import block, outline, part, place_solid, plate, rod, union
from robots.dvrk import psm
from robots.dvrk.end_effectors.end_effector import Mount
from robots.dvrk.instruments import SHAFT_RADIUS, WRIST_RADIUS, Instrument
from schemas.vectors import Vector

__all__ = ["parts"]

_HOUSING_END = 0.4080
"""Height of the housing's lower face over the remote centre, m."""


def parts(tool: Instrument) -> Looks:
    """Return the meshes by body."""
    chain = psm.chain(tool)
    frames = chain.frames(np.zeros(len(chain.joints)))[3:-1]
    shaft = _shaft_solid(frames[1]) if tool.has_wrist else _plain_shaft(frames[0])
    looks = {"insertion": _housing_solids(), "roll": shaft}
    for joint, frame, below in zip(tool.joints[1:-1], frames[1:-1], frames[2:], strict=True):
        looks[joint.name] = (_wrist_link(joint.name, frame, below),)
    if tool.has_wrist:
        looks[tool.joints[-1].name] = (_pin_solid(tool.joints[-1].name, frames[-1]),)
    for body, added in end_effectors.parts(tool.end_effector, tool.name, Mount.on(chain)).items():
        looks[body] = (*looks.get(body, ()), *added)
    return looks


def _plain_shaft(end: Vector) -> tuple[Part, ...]:
    """Return a shaft without a wrist, down to `end`, shape (4, 4)."""
    tube = rod((0.0, 0.0, end[2, 3]), (0.0, 0.0, _HOUSING_END + 0.001), SHAFT_RADIUS, segments=14)
    return (part("shaft", tube, BLACK),)


def _housing_solids() -> tuple[Part, ...]:
    """Housing before the sterile adapter, with the two release levers."""
    face = outline(
        [(0.430, -0.034), (0.5010, -0.030), (0.5010, 0.030), (0.430, 0.034), (0.418, 0.027), (0.418, -0.027)]
    )
    shell = plate("y", face, -0.0150, 0.0158, 0.005)
    neck = rod((0.0, 0.0, _HOUSING_END), (0.0, 0.0, 0.425), 0.0085, 0.0145)
    levers = [block((x - 0.0025, -0.0080, 0.448), (x + 0.0025, 0.0060, 0.482)) for x in (-0.0335, 0.0335)]
    return part("housing", union(shell, neck), SLATE), part("levers", union(*levers), BLUE)


def _shaft_solid(pitch: Vector) -> tuple[Part, ...]:
    """Shaft down to the clevis about the wrist pitch axis, z of `pitch`, shape (4, 4)."""
    height = pitch[2, 3]
    tube = rod((0.0, 0.0, height + 0.0091), (0.0, 0.0, _HOUSING_END + 0.001), SHAFT_RADIUS, segments=12)
    core = rod((0.0, 0.0, height - 0.0019), (0.0, 0.0, height + 0.0091), SHAFT_RADIUS - 4e-5, segments=12)
    slot = place_solid(
        block((-0.01, -0.01, -0.01), (0.01, 0.01, 0.0028)) ^ block((-0.0021, -1.0, -1.0), (0.0021, 1.0, 1.0)),
        _drawing_axes(pitch),
        pitch[:3, 3],
    )
    flats = [
        block((-0.01, side * 0.0066 - 0.004, -0.0030), (0.01, side * 0.0066 + 0.004, 0.0))
        for side in (-1.0, 1.0)
    ]
    ears = core - slot - place_solid(union(*flats), _drawing_axes(pitch), pitch[:3, 3])
    return part("shaft", tube, BLACK), part("clevis", ears, STEEL)


def _drawing_axes(pitch: Vector) -> Vector:
    """Return the axes of a wrist link's drawing, shape (3, 3): x along its joint, z back along the shaft."""
    return np.column_stack([pitch[:3, 2], np.cross((0.0, 0.0, 1.0), pitch[:3, 2]), (0.0, 0.0, 1.0)])


def _wrist_link(name: str, frame: Vector, below: Vector) -> Part:
    """Link from z of `frame` to z of `below`, with a hub in the clevis above, and ears below."""
    axes, length = _drawing_axes(frame), float(np.linalg.norm(below[:3, 3] - frame[:3, 3]))
    if length < 1e-6:  # two crossed joints of a snake wrist
        return part(
            name,
            place_solid(rod((0.0, 0.0, -0.0015), (0.0, 0.0, 0.0015), 0.0019), axes, frame[:3, 3]),
            STEEL,
        )
    hub = rod((-0.0020, 0.0, 0.0), (0.0020, 0.0, 0.0), min(0.0024, 0.6 * length))
    body = rod((0.0, 0.0, -length - 0.0015), (0.0, 0.0, -0.2 * length), WRIST_RADIUS)
    waist = block((-0.0020, -0.0022, -0.6 * length), (0.0020, 0.0022, 0.0))
    slot = block((-1.0, -0.0020, -1.0), (1.0, 0.0020, -length + min(0.0032, 0.4 * length)))
    return part(name, place_solid(union(hub, body - slot, waist), axes, frame[:3, 3]), STEEL)


def _pin_solid(name: str, frame: Vector) -> Part:
    """Pin of the wrist yaw."""
    pin = rod((0.0, 0.0, -0.0034), (0.0, 0.0, 0.0034), 0.0011)
    return part(name, place_solid(pin, frame[:3, :3], frame[:3, 3]), STEEL)
