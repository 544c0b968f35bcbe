"""Solids that the looks are cut from: rounded plates, rods, turned pieces, and their meshes.

Metres; built on manifold3d.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from manifold3d import CrossSection, JoinType, Manifold, OpType

from engines.mujoco.looks.part import Material, Part
from schemas.vectors import Vector

__all__ = [
    "Axis",
    "block",
    "cannula",
    "cheeks",
    "circle",
    "hull",
    "outline",
    "part",
    "place_solid",
    "plate",
    "revolve",
    "rod",
    "symmetric",
    "taper",
    "union",
]

Axis = Literal["x", "y", "z"]
Point2 = tuple[float, float]
Point3 = tuple[float, float, float]

_SHARP = 40.0
"""Degrees between two faces above which their edge is drawn sharp: below the 45 degrees of a bevel, above the
steps of a round.
"""
_CORNER = 4
"""Segments of a full turn of a rounded corner: a right angle is cut by one."""
_ROUND, _BOLT, _BOLT_RADIUS = 10, 6, 0.020
"""Segments of a circle, each turning by less than `_SHARP`, so that it is shaded as a round; below this
radius (m) of a bolt's head.
"""
_DETAIL, _LENGTH_SHARE, _THICKNESS_SHARE = 7.0e-4, 0.02, 0.25
"""What a mesh leaves out: details smaller than 0.7 mm, a fifth of a pixel in an image of the whole cart, and
than these shares of the part.
"""
_FLAT = 1.0e-7
"""m by which rounding may carry a corner of a hull out of the face it lies in."""
_TURNS = {
    "x": np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    "y": np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
    "z": np.eye(3),
}
"""Matrices from (u, v, w), with w the axis of an extrusion, to (x, y, z): the plane is (y, z), (z, x) or (x,
y).
"""


def outline(points: Sequence[Point2], radius: float = 0.0) -> CrossSection:
    """Return the polygon through `points`, counter-clockwise, its corners rounded by `radius`."""
    polygon = CrossSection([np.array(points)])
    if radius == 0.0:
        return polygon
    inner = polygon.offset(-radius, JoinType.Miter, 4.0)
    return inner.offset(radius, JoinType.Round, circular_segments=_CORNER)


def symmetric(half: Sequence[Point2], radius: float = 0.0) -> CrossSection:
    """Return the outline of which `half` is the right half, an open polygon, counter-clockwise."""
    return outline([*half, *((-u, v) for u, v in reversed(half))], radius)


def circle(centre: Point2, radius: float, segments: int = 0) -> CrossSection:
    """Return a disc's outline."""
    return CrossSection.circle(radius, segments or _segments(radius)).translate(centre)


def taper(*discs: tuple[Point2, float]) -> CrossSection:
    """Return the outline of a strap around discs, each given by centre and radius."""
    return CrossSection.batch_hull([circle(centre, radius) for centre, radius in discs])


def plate(axis: Axis, shape: CrossSection, low: float, high: float, bevel: float = 0.0) -> Manifold:
    """Extrude `shape`, drawn in the plane (y, z), (z, x) or (x, y), along `axis` from `low` to `high`.

    With a bevel the shape must be convex: what it leaves open the bevel would close.
    """
    solid = Manifold.extrude(shape, high - low - 2.0 * bevel).translate((0.0, 0.0, low + bevel))
    if bevel > 0.0:
        inner = shape.offset(-bevel, JoinType.Round, circular_segments=_CORNER)
        solid = Manifold.batch_hull([solid, Manifold.extrude(inner, high - low).translate((0.0, 0.0, low))])
    return place_solid(solid, _TURNS[axis])


def cheeks(shape: CrossSection, inner: float, outer: float, bevel: float = 0.0) -> Manifold:
    """Return two plates, drawn in the plane (y, z), at either side of x = 0 between two distances from it."""
    one = plate("x", shape, inner, outer, bevel)
    return one + one.mirror((1.0, 0.0, 0.0))


def block(low: Point3, high: Point3, bevel: float = 0.0) -> Manifold:
    """Return the box between two corners, its edges cut by `bevel`."""
    lower, upper = np.array(low), np.array(high)
    if bevel == 0.0:
        return Manifold.cube(upper - lower).translate(low)
    slabs = [
        Manifold.cube(upper - lower - 2.0 * cut).translate(lower + cut) for cut in bevel * (1.0 - np.eye(3))
    ]
    return Manifold.batch_hull(slabs)


def rod(
    start: Point3, end: Point3, radius: float, end_radius: float | None = None, segments: int = 0
) -> Manifold:
    """Return a round bar from `start` to `end`, conical if `end_radius` differs."""
    axis = np.array(end) - np.array(start)
    length = float(np.linalg.norm(axis))
    solid = Manifold.cylinder(
        length, radius, -1.0 if end_radius is None else end_radius, segments or _segments(radius)
    )
    return place_solid(solid, _turn_to(axis / length), start)


def revolve(
    profile: Sequence[Point2],
    origin: Point3 = (0.0, 0.0, 0.0),
    axis: Point3 = (0.0, 0.0, 1.0),
    segments: int = 0,
) -> Manifold:
    """Turn a profile of (radius, height above `origin`), counter-clockwise, about `axis`."""
    direction = np.array(axis) / np.linalg.norm(axis)
    return place_solid(
        Manifold.revolve(
            CrossSection([np.array(profile)]), segments or _segments(max(r for r, _ in profile))
        ),
        _turn_to(direction),
        origin,
    )


def cannula(radius: float, bowl: float, low: float, high: float) -> Manifold:
    """Return a tube about the z axis from `low` up to a bowl that ends at `high`.

    A thick ring marks the remote centre, z = 0.
    """
    profile = [
        (0.0, low),
        (radius, low),
        (radius, -0.004),
        (1.12 * radius, -0.004),
        (1.12 * radius, 0.004),
        (radius, 0.004),
    ]
    return revolve([*profile, (radius, 0.040), (bowl, 0.048), (bowl, high), (0.0, high)])


def union(*solids: Manifold) -> Manifold:
    """Join solids into one."""
    return Manifold.batch_boolean(solids, OpType.Add)


def hull(name: str, points: Vector, material: Material) -> Part:
    """Return the convex hull of points, shape (n, 3)."""
    mesh = Manifold.hull_points(points).simplify(_FLAT).to_mesh64()
    return Part(
        name, np.array(mesh.vert_properties[:, :3]), np.array(mesh.tri_verts, dtype=np.int32), material
    )


def place_solid(
    solid: Manifold, rotation: Vector, translation: Sequence[float] | Vector = (0.0, 0.0, 0.0)
) -> Manifold:
    """Return `solid` turned by `rotation`, shape (3, 3), then moved by `translation`."""
    return solid.transform(np.column_stack([rotation, np.asarray(translation)]))


def part(name: str, solid: Manifold, material: Material) -> Part:
    """Return the mesh of `solid` without invisible details, with a vertex for each side of a sharp edge."""
    low, high = np.split(np.array(solid.bounding_box()), 2)
    extent = (high - low).tolist()
    plain = solid.simplify(min(_DETAIL, _LENGTH_SHARE * max(extent), _THICKNESS_SHARE * min(extent)))
    mesh = plain.calculate_normals(0, _SHARP).to_mesh64()
    return Part(
        name, np.array(mesh.vert_properties[:, :3]), np.array(mesh.tri_verts, dtype=np.int32), material
    )


def _segments(radius: float) -> int:
    """Return into how many straight pieces a circle is cut."""
    return _BOLT if radius < _BOLT_RADIUS else _ROUND


def _turn_to(direction: Vector) -> Vector:
    """Return a rotation, shape (3, 3), that takes z to the unit vector `direction`."""
    side = np.eye(3)[int(np.argmin(np.abs(direction)))]
    x = np.cross(side, direction)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(direction, x), direction])
