"""The table and movable objects, as bodies of the MuJoCo model.

A bent wire is a row of capsules. Mass, centre and inertia of the smooth wire do not depend on the number of
capsules. A triangular ring is three boxes with round edges.
"""

from __future__ import annotations

from hashlib import blake2b
from itertools import pairwise
from math import acos, ceil, pi, sin, sqrt
from typing import Any

import mujoco
import numpy as np

from engines.mujoco.object_params import (
    BlockParams,
    NeedleParams,
    ObjectParams,
    PieceParams,
    RingParams,
    TableParams,
    TriangleParams,
)
from robots import rotation
from robots.training.boards import Ring
from robots.training.dishes import PIECE
from schemas.vectors import Vector

__all__ = ["CONTACT", "LEVEL", "add", "add_table", "start_pose", "wire_inertia"]

CONTACT: dict[str, Any] = {
    "condim": 4,
    "friction": [1.0, 0.005, 0.0001],
    "solref": [0.001, 1.0],
    "solimp": [0.999, 0.9999, 0.0001, 0.5, 2.0],
    "priority": 1,
}
"""How objects touch: by sliding and twisting friction, and stiffer than MuJoCo's default, so that a light
thin wire does not sink into a jaw (docs/decisions/0012). The priority makes this hold for every pair that has
an object in it. Friction coefficients are MuJoCo's defaults; 1 stands for the knurled jaws of a needle
driver.
"""

_THINGS, _TABLE, _WIRES = 1, 32, 64
"""Collision bits beside those of the arms (engines.mujoco.model.shapes): of all that is not a wire, as is
MuJoCo's default; of tables; of wires among each other. A wire lies on a table with a few balls, so that one
at rest costs a few contacts and not two for each of its capsules.
"""
LEVEL = {"contype": _THINGS, "conaffinity": _TABLE}
"""Collision bits of surfaces under objects."""
_PAD = {"contype": 0, "conaffinity": _TABLE}
"""Collision bits of a soft table: touched by objects, not by instruments."""
_SOLID = {"contype": _THINGS | _TABLE, "conaffinity": _THINGS}
"""Collision bits of an object with flat faces."""
_BALLS_APART = pi / 4.0
"""Greatest angle between two balls of a wire, rad."""
_RGBA = {
    "ring": [0.85, 0.2, 0.15, 1.0],
    "needle": [0.8, 0.8, 0.85, 1.0],
    "block": [0.9, 0.75, 0.2, 1.0],
    "table": [0.32, 0.45, 0.4, 1.0],
}
_GREEN, _BLUE = [0.05, 0.8, 0.1, 1.0], [0.05, 0.1, 0.95, 1.0]
_TIP_BALL = 0.45e-3
"""Radius, m, of the ball at the tip of a marked needle (unina-icaros/dvrk-vrep, dVRK-needletracking.ttt)."""
_COLOURS = (
    [0.9, 0.2, 0.15, 1.0],
    [0.95, 0.75, 0.1, 1.0],
    [0.15, 0.45, 0.85, 1.0],
    [0.2, 0.7, 0.3, 1.0],
    [0.95, 0.45, 0.1, 1.0],
    [0.6, 0.3, 0.75, 1.0],
)
"""Colours of pieces and triangular rings, by the number in the name."""
_CORE = 0.9
"""Thickness of a ring's wall between the edges, as a share of the edges' thickness."""
_ROUNDNESS = 0.1
"""Greatest distance of a wire's capsules from the centre line, as a share of the wire's radius."""


def add_table(spec: mujoco.MjSpec, params: TableParams) -> None:
    """Add the table to the world, as a separate body.

    MuJoCo pairs geoms of the world body with every link, however far away.
    """
    x, y, z = params.position
    half = [extent / 2.0 for extent in params.size]
    bits = _PAD if params.soft else LEVEL
    if params.friction is not None:  # before that of things, and with sliding friction alone
        bits = bits | _contact_friction(params.friction) | {"condim": 3, "priority": CONTACT["priority"] + 1}
    body = spec.worldbody.add_body(name="table", pos=[x, y, z - half[2]])
    body.add_geom(name="table", type=mujoco.mjtGeom.mjGEOM_BOX, size=half, rgba=_RGBA["table"], **bits)


def start_pose(name: str, params: ObjectParams, seed: int | None) -> tuple[Vector, Vector]:
    """Return where the object `name` starts in the world: position (m) and quaternion (x, y, z, w).

    A `seed` moves and turns the start by shares of `scatter`, the same on every machine.
    """
    position, turn = np.array(params.position), np.array(params.orientation)
    if seed is None or not any(params.scatter):
        return position, turn
    drawn = np.frombuffer(blake2b(f"{seed}/{name}".encode(), digest_size=24).digest(), "<u8")
    x, y, angle = params.scatter * (drawn / 2.0**63 - 1.0)
    position[:2] += x, y
    return position, rotation.product(rotation.exp(np.array([0.0, 0.0, angle])), turn)


def add(spec: mujoco.MjSpec, name: str, params: ObjectParams, seed: int | None = None) -> None:
    """Add a movable object as the body `name`, in the object's frame, with the free joint `name`."""
    position, (x, y, z, w) = start_pose(name, params, seed)
    body = spec.worldbody.add_body(name=name, pos=position, quat=[w, x, y, z])
    body.add_freejoint(name=name)
    match params:
        case BlockParams():
            half = [extent / 2.0 for extent in params.size]
            body.add_geom(
                type=mujoco.mjtGeom.mjGEOM_BOX,
                size=half,
                density=params.density,
                rgba=_RGBA[params.kind],
                **_SOLID,
                **CONTACT,
            )
        case RingParams() | NeedleParams():
            _add_wire(body, params)
        case PieceParams():
            half = [extent / 2.0 for extent in PIECE.size]
            body.add_geom(
                type=mujoco.mjtGeom.mjGEOM_BOX,
                size=half,
                mass=PIECE.mass,
                rgba=_colour(name),
                **_SOLID,
                **_contact_friction(PIECE.friction),
            )
        case TriangleParams():
            _add_triangle(body, params.measures, _colour(name))


def _colour(name: str) -> list[float]:
    number = "".join(filter(str.isdigit, name))
    return _COLOURS[(int(number or 1) - 1) % len(_COLOURS)]


def _contact_friction(friction: float) -> dict[str, Any]:
    """Return how an object with this Coulomb coefficient touches."""
    return CONTACT | {"friction": [friction, *CONTACT["friction"][1:]]}


def _add_triangle(body: mujoco.MjsBody, ring: Ring, rgba: list[float]) -> None:
    """Add three walls with round edges, and balls in the corners with which the ring lies on what is level.

    Jaws that are not parallel touch a wall along its edge. Between a capsule and a box MuJoCo finds the same
    two contacts step by step; between two boxes their number changes, and each change is a blow.
    """
    middle, half, edge = ring.inradius + ring.thickness / 2.0, ring.height / 2.0, ring.thickness / 2.0
    length = sqrt(3.0) * middle
    bits = {"contype": _THINGS | _WIRES, "conaffinity": _WIRES}
    contact = _contact_friction(ring.friction)
    for k in range(3):
        turn = (2.0 * k + 0.5) * pi / 3.0  # of the outward normal; a corner lies on y
        normal, along = (
            np.array([np.cos(turn), np.sin(turn), 0.0]),
            np.array([-np.sin(turn), np.cos(turn), 0.0]),
        )
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[_CORE * edge, length, half - edge],
            pos=middle * normal,
            quat=[np.cos(turn / 2.0), 0.0, 0.0, np.sin(turn / 2.0)],
            mass=ring.mass / 3.0,
            rgba=rgba,
            **bits,
            **contact,
        )
        for z in (edge - half, half - edge):
            ends = np.array([middle * normal + side * length * along + [0.0, 0.0, z] for side in (-1.0, 1.0)])
            body.add_geom(
                type=mujoco.mjtGeom.mjGEOM_CAPSULE,
                size=[edge, 0.0, 0.0],
                fromto=ends.ravel(),
                mass=0.0,
                rgba=rgba,
                **bits,
                **contact,
            )
            body.add_geom(
                type=mujoco.mjtGeom.mjGEOM_SPHERE,
                size=[edge, 0.0, 0.0],
                pos=ends[1],
                mass=0.0,
                rgba=rgba,
                contype=_TABLE,
                conaffinity=0,
                **contact,
            )


def _add_wire(body: mujoco.MjsBody, params: RingParams | NeedleParams) -> None:
    radius, thickness = params.radius, params.wire_radius
    # the angle whose chord is that far from its arc
    most = 2.0 * acos(1.0 - min(1.0, _ROUNDNESS * thickness / radius))
    points = _on_arc(params, max(4, ceil(params.arc / most)))
    is_marked = isinstance(params, NeedleParams) and params.marked
    rgba = _GREEN if is_marked else _RGBA[params.kind]
    for start, end in pairwise(points):
        size, ends = [thickness, 0.0, 0.0], np.concatenate([start, end])
        bits = {"contype": _THINGS | _WIRES, "conaffinity": _WIRES}
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=size, fromto=ends, mass=0.0, rgba=rgba, **bits, **CONTACT
        )
    for point in _on_arc(params, ceil(params.arc / _BALLS_APART)):
        size, bits = [thickness, 0.0, 0.0], {"contype": _TABLE, "conaffinity": 0}
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_SPHERE, size=size, pos=point, mass=0.0, rgba=rgba, **bits, **CONTACT
        )
    if is_marked:
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[_TIP_BALL, 0.0, 0.0],
            pos=points[-1],
            mass=0.0,
            rgba=_BLUE,
            contype=0,
            conaffinity=0,
        )
    mass, centre, inertia = wire_inertia(radius, thickness, params.arc, params.density)
    body.mass, body.ipos, body.inertia, body.explicitinertial = mass, [centre, 0.0, 0.0], inertia, True


def _on_arc(params: RingParams | NeedleParams, count: int) -> Vector:
    """Return the ends of `count` equal pieces of the centre line, shape (count + 1, 3)."""
    angles = np.linspace(-params.arc / 2.0, params.arc / 2.0, count + 1)
    return params.radius * np.stack([np.cos(angles), np.sin(angles), np.zeros(count + 1)], axis=1)


def wire_inertia(radius: float, thickness: float, arc: float, density: float) -> tuple[float, float, Vector]:
    """Return mass (kg), centre of mass (m) and principal moments (kg m^2) of a wire along an arc.

    The centre of mass is given by its distance from the arc's centre; the moments are about the centre of
    mass. For a thin wire along r (cos a, sin a, 0), |a| < arc/2, they are means of cos^2 and sin^2 over the
    arc; each section adds m s^2/4 about its diameters and m s^2/2 about the tangent (s: `thickness`).

    Args:
        radius: of the centre line, m.
        thickness: radius of the cross-section, m.
        arc: from end to end, rad; the wire lies in the plane z = 0, its middle on the x axis.
        density: kg/m^3.
    """
    mass = density * pi * thickness**2 * radius * arc
    centre = radius * sin(arc / 2.0) / (arc / 2.0)
    cos2 = 0.5 + sin(arc) / (2.0 * arc)
    sin2 = 1.0 - cos2
    section = thickness**2 / 4.0
    x = radius**2 * sin2 + section * (1.0 + sin2)
    y = radius**2 * cos2 - centre**2 + section * (1.0 + cos2)
    z = radius**2 - centre**2 + section
    return mass, centre, mass * np.array([x, y, z])
