"""Triangles of MuJoCo's primitive geometries, about the origin of their own frame, in metres."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from schemas.vectors import Vector

__all__ = ["Triangles", "solid_mesh"]

_AROUND, _RINGS = 16, 6
"""Corners around a round solid, and rings from pole to pole."""
_PLANE_M = 2.0
"""Half the side of a plane without end."""


class Triangles(NamedTuple):
    """A mesh."""

    vertices: NDArray[np.float64]
    """Shape (n, 3), m."""
    faces: NDArray[np.int64]
    """Shape (f, 3), counter-clockwise from outside."""


def solid_mesh(kind: mujoco.mjtGeom, size: Vector, around: int = _AROUND, rings: int = _RINGS) -> Triangles:
    """Return the mesh of a geometry; of other kinds an empty one.

    Args:
        kind: of the geometry.
        size: shape (3,), m, as MuJoCo means it.
        around: corners around a round solid.
        rings: rings from pole to pole.
    """
    geom, (a, b, c) = mujoco.mjtGeom, size.tolist()
    if kind == geom.mjGEOM_BOX:
        return _revolve_profile([(a, -c), (a, c)], corners=4, flat=(a, b))
    if kind == geom.mjGEOM_PLANE:
        return _rectangle(a or _PLANE_M, b or _PLANE_M)
    if kind == geom.mjGEOM_CYLINDER:
        return _revolve_profile([(0.0, -b), (a, -b), (a, b), (0.0, b)], around)
    angles = np.linspace(-np.pi / 2, np.pi / 2, rings + 1)
    profile: list[tuple[float, float]] = np.column_stack([np.cos(angles), np.sin(angles)]).tolist()
    if kind == geom.mjGEOM_CAPSULE:
        return _revolve_profile([(a * r, a * z + (b if z > 0.0 else -b)) for r, z in profile], around)
    if kind == geom.mjGEOM_SPHERE:
        return _revolve_profile([(a * r, a * z) for r, z in profile], around)
    if kind == geom.mjGEOM_ELLIPSOID:
        round_ = _revolve_profile(profile, around)
        return Triangles(round_.vertices * size, round_.faces)
    return Triangles(np.zeros((0, 3)), np.zeros((0, 3), np.int64))


def _revolve_profile(
    profile: list[tuple[float, float]], corners: int = _AROUND, flat: tuple[float, float] | None = None
) -> Triangles:
    """Return the solid between rings (radius, height), closed at both ends.

    `flat`: half the sides of a box, whose four corners take the place of a circle's.
    """
    if flat is None:
        turns = 2.0 * np.pi * np.arange(corners) / corners
        circle = np.column_stack([np.cos(turns), np.sin(turns)])
        rings = [np.column_stack([radius * circle, np.full(corners, z)]) for radius, z in profile]
    else:
        square = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]) * flat
        rings = [np.column_stack([square, np.full(corners, z)]) for _, z in profile]
    low, high = rings[0].mean(axis=0), rings[-1].mean(axis=0)
    vertices = np.concatenate([*rings, low[None], high[None]])
    here = np.arange(corners)
    after = (here + 1) % corners
    faces: list[NDArray[np.int64]] = []
    for ring in range(len(rings) - 1):
        start, above = ring * corners, (ring + 1) * corners
        faces.append(np.column_stack([start + here, start + after, above + after]))
        faces.append(np.column_stack([start + here, above + after, above + here]))
    end = len(rings) * corners
    faces.append(np.column_stack([after, here, np.full(corners, end)]))
    top = end - corners
    faces.append(np.column_stack([top + here, top + after, np.full(corners, end + 1)]))
    return Triangles(vertices, np.concatenate(faces))


def _rectangle(a: float, b: float) -> Triangles:
    corners = np.array([[a, b, 0.0], [-a, b, 0.0], [-a, -b, 0.0], [a, -b, 0.0]])
    return Triangles(corners, np.array([[0, 1, 2], [0, 2, 3]]))
