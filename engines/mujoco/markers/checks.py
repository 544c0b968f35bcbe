"""What a marker must satisfy to be shown; the rules are those of RViz where RViz has one."""

from __future__ import annotations

from collections.abc import Collection
from math import hypot

import numpy as np

from schemas.errors import MessageError, did_you_mean
from schemas.ros import Quaternion
from schemas.vectors import Vector
from schemas.visualization import ColorRGBA, Marker, MarkerType

__all__ = ["MOST_LETTERS", "check", "orientation"]

MOST_LETTERS = 256
"""Most letters in a text, and in the name of a namespace."""
_FARTHEST = 100.0
"""m; of a position from its frame, and of a size: a scene has the size of a room."""
_QUATERNION_TOLERANCE = 1e-3
"""Tolerance of the norm, as for the values of signals (schemas.vectors)."""
_SOLID = ("x", "y", "z")
_SIZES: dict[MarkerType, tuple[str, ...]] = {
    MarkerType.ARROW: ("x", "y"),
    MarkerType.CUBE: _SOLID,
    MarkerType.SPHERE: _SOLID,
    MarkerType.CYLINDER: _SOLID,
    MarkerType.LINE_STRIP: ("x",),
    MarkerType.LINE_LIST: ("x",),
    MarkerType.CUBE_LIST: _SOLID,
    MarkerType.SPHERE_LIST: _SOLID,
    MarkerType.POINTS: ("x", "y"),
    MarkerType.TEXT_VIEW_FACING: ("z",),
    MarkerType.MESH_RESOURCE: _SOLID,
    MarkerType.TRIANGLE_LIST: _SOLID,
    MarkerType.ARROW_STRIP: ("x", "y"),
}
"""Parts of `scale` that must be above 0."""
_LISTS: dict[MarkerType, tuple[int, int]] = {
    MarkerType.LINE_STRIP: (2, 1),
    MarkerType.LINE_LIST: (2, 2),
    MarkerType.CUBE_LIST: (1, 1),
    MarkerType.SPHERE_LIST: (1, 1),
    MarkerType.POINTS: (1, 1),
    MarkerType.TRIANGLE_LIST: (3, 3),
    MarkerType.ARROW_STRIP: (2, 1),
}
"""Fewest points, and of what their number must be a multiple."""


def check(marker: Marker, points: Vector, frames: Collection[str], objects: Collection[str]) -> None:
    """Raise MessageError, with the reason, if a marker that is to be added cannot be shown.

    Args:
        marker: to add or change.
        points: points, or points of the mesh, shape (n, 3), m.
        frames: that the scene has.
        objects: whose shapes a mesh may be.
    """
    frame = marker.header.frame_id
    if frame not in frames:
        raise MessageError(f"frame_id '{frame}' is no frame of this scene.{did_you_mean(frame, frames)}")
    if len(marker.ns) > MOST_LETTERS:
        raise MessageError(f"a namespace of {len(marker.ns)} letters; allowed are {MOST_LETTERS}")
    if marker.type not in _SIZES:
        raise MessageError(f"type {marker.type} is unknown; allowed are 0 (ARROW) to 12 (ARROW_STRIP)")
    kind = MarkerType(marker.type)
    _check_numbers(marker, kind, points)
    _check_points(kind, points)
    _check_colors(marker, kind, len(points))
    if kind is MarkerType.TEXT_VIEW_FACING and not 0 < len(marker.text) <= MOST_LETTERS:
        raise MessageError(f"a text of {len(marker.text)} letters; allowed are 1 to {MOST_LETTERS}")
    if kind is MarkerType.MESH_RESOURCE and not marker.mesh_file.data.size:
        _check_mesh(marker, objects)
    if marker.texture_resource or marker.texture.data.size:
        raise MessageError("textures are not drawn: leave them out")
    if marker.lifetime.ns < 0:
        raise MessageError(f"lifetime {marker.lifetime.ns / 1e9:g} s is below 0, which means for ever")


def _check_numbers(marker: Marker, kind: MarkerType, points: Vector) -> None:
    position = marker.pose.position
    far = np.abs([position.x, position.y, position.z]).max()
    if far > _FARTHEST or (points.size and np.abs(points).max() > _FARTHEST):
        raise MessageError(f"a position is more than {_FARTHEST:g} m from its frame; lengths are in metres")
    orientation(marker.pose.orientation)
    for axis in _SIZES[kind]:
        size = getattr(marker.scale, axis)
        if not 0.0 < size <= _FARTHEST:
            raise MessageError(
                f"scale.{axis} of {kind.name} is {size:g} m, allowed are sizes above 0 up to {_FARTHEST:g}"
            )


def _check_points(kind: MarkerType, points: Vector) -> None:
    if kind is MarkerType.ARROW and len(points) not in (0, 2):
        raise MessageError(
            f"an ARROW with {len(points)} points; it has two, start and end, or none and a pose"
        )
    fewest, multiple = _LISTS.get(kind, (0, 1))
    if len(points) < fewest or len(points) % multiple:
        what = f"at least {fewest}" + (f", a multiple of {multiple}" if multiple > 1 else "")
        raise MessageError(f"{kind.name} with {len(points)} points; it needs {what}")


def _check_colors(marker: Marker, kind: MarkerType, points: int) -> None:
    count = len(marker.colors)
    faces = points // 3 if kind is MarkerType.TRIANGLE_LIST else points
    if count not in (0, points, faces):
        raise MessageError(f"{count} colors for {points} points; one for each, or none")
    for color in (marker.color, *marker.colors):
        if not _is_color(color):
            raise MessageError(f"color ({color.r:g}, {color.g:g}, {color.b:g}, {color.a:g}): all from 0 to 1")


def _is_color(color: ColorRGBA) -> bool:
    return all(0.0 <= part <= 1.0 for part in (color.r, color.g, color.b, color.a))


def _check_mesh(marker: Marker, objects: Collection[str]) -> None:
    if marker.mesh_resource not in objects:
        raise MessageError(
            f"mesh_resource '{marker.mesh_resource}' is no object of this scene (there are:"
            f" {', '.join(objects) or 'none'}), and files are not read for programs: send the mesh as"
            " mesh_file (a binary STL) or as a TRIANGLE_LIST"
        )
    scale = marker.scale
    if not scale.x == scale.y == scale.z:
        raise MessageError("an object is scaled by the same number along x, y and z")


def orientation(q: Quaternion) -> Vector:
    """Return a quaternion (x, y, z, w) with norm 1; all zeros, as ROS 1 begins, are no turn.

    Raises MessageError if it is no rotation.
    """
    norm = hypot(q.x, q.y, q.z, q.w)
    if norm == 0.0:
        return np.array([0.0, 0.0, 0.0, 1.0])
    if abs(norm - 1.0) > _QUATERNION_TOLERANCE:
        raise MessageError(
            f"quaternion (x, y, z, w) has norm {norm:.6g}, expected 1 within {_QUATERNION_TOLERANCE:g}"
        )
    return np.array([q.x, q.y, q.z, q.w]) / norm
