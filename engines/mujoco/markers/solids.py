"""What a marker consists of: solids that MuJoCo can draw, with their poses in the world.

Sizes are those of RViz: of a sphere, cube or cylinder the three extents, of a line its thickness, of a
text the height of a capital letter. Lines are rows of bars and texts rows of thin boxes that face the camera,
so both have a place and a depth in either eye, and whatever is nearer hides them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from engines.mujoco.markers.lettering import STROKE, segments
from engines.mujoco.markers.store import PoseOf, ShownMarker
from robots import rotation
from schemas.vectors import Vector
from schemas.visualization import MarkerType

__all__ = ["Shape", "ShapesOf", "Solid", "extents", "solids"]

_LIT, _FLAT = 0.35, 0.6
"""Share of its colour that a solid has where no light falls, to which the lamps add theirs. Lines and letters
have more: with the endoscope's own lamp they come to their colour, and stay legible without it.
"""

_TINY = np.finfo(np.float64).tiny


@dataclass(frozen=True, slots=True)
class Solid:
    """An object to draw."""

    type: int
    """An `mjtGeom`."""
    size: Vector
    """Shape (3,), m, as MuJoCo has it."""
    position: Vector
    """Shape (3,), m, in the world."""
    turn: Vector
    """Shape (3, 3), from its own axes to those of the world."""
    rgba: NDArray[np.float32]
    """Shape (4,)."""
    emission: float = _LIT
    is_metal: bool = False
    """Drawn as metal with shadows where the renderer can."""


@dataclass(frozen=True, slots=True)
class Shape:
    """A shape of an object, in the object's frame; as in `Solid`."""

    type: int
    size: Vector
    position: Vector
    turn: Vector


ShapesOf = Callable[[str], Sequence[Shape]]
"""Returns the shapes of an object by its name."""


def extents(kind: int, size: Vector) -> Vector:
    """Return the `size` of a model's geom, shape (3,), as it is in a scene: along x, y and z."""
    match kind:
        case mujoco.mjtGeom.mjGEOM_SPHERE:
            return size[[0, 0, 0]]
        case mujoco.mjtGeom.mjGEOM_CAPSULE | mujoco.mjtGeom.mjGEOM_CYLINDER:
            return size[[0, 0, 1]]
        case _:
            return size.copy()


def solids(marker: ShownMarker, pose_of: PoseOf, camera: Vector, shapes_of: ShapesOf) -> Iterator[Solid]:
    """Yield the solids of a marker.

    Args:
        marker: to draw.
        pose_of: where frames are in the state drawn.
        camera: the optical frame in the world, shape (4, 4); texts face it.
        shapes_of: the shapes of the scene's objects.
    """
    frame = pose_of(marker.frame)
    turn = frame[:3, :3] @ rotation.matrix(marker.pose[3:])
    position = frame[:3, :3] @ marker.pose[:3] + frame[:3, 3]
    points = marker.points @ turn.T + position
    half = 0.5 * marker.scale
    match marker.type:
        case MarkerType.ARROW if len(points):
            yield from _rod_solids(points[:1], points[1:], half[0], marker.color[None], _ARROW)
        case MarkerType.ARROW:
            end = position + marker.scale[0] * turn[:, 0]
            yield from _rod_solids(position[None], end[None], half[1], marker.color[None], _ARROW)
        case MarkerType.ARROW_STRIP:
            yield from _rod_solids(points[:-1], points[1:], half[0], _colors(marker, len(points)), _ARROW)
        case MarkerType.LINE_STRIP:
            yield from _rod_solids(points[:-1], points[1:], half[0], _colors(marker, len(points)), _BOX)
        case MarkerType.LINE_LIST:
            colors = _colors(marker, len(points))[::2]
            yield from _rod_solids(points[::2], points[1::2], half[0], colors, _BOX)
        case MarkerType.CUBE_LIST | MarkerType.SPHERE_LIST:
            for point, color in zip(points, _colors(marker, len(points)), strict=True):
                yield Solid(_SOLID[marker.type], half, point, turn, color)
        case MarkerType.POINTS:
            facing, size = _facing_axes(camera), half[[0, 1, 0]]
            for point, color in zip(points, _colors(marker, len(points)), strict=True):
                yield Solid(_BOX, size, point, facing, color, _FLAT)
        case MarkerType.TRIANGLE_LIST:
            yield from _triangles(marker.points * marker.scale @ turn.T + position, marker)
        case MarkerType.TEXT_VIEW_FACING:
            yield from _text(marker, position, _facing_axes(camera))
        case MarkerType.MESH_RESOURCE:
            scale = marker.scale[0]
            for shape in shapes_of(marker.text):
                where = position + turn @ (scale * shape.position)
                yield Solid(shape.type, scale * shape.size, where, turn @ shape.turn, marker.color)
        case _:
            kind = _SOLID[marker.type]
            yield Solid(kind, half, position, turn, marker.color, is_metal=marker.is_metal)


_BOX, _ELLIPSOID = int(mujoco.mjtGeom.mjGEOM_BOX), int(mujoco.mjtGeom.mjGEOM_ELLIPSOID)
_ARROW, _TRIANGLE = int(mujoco.mjtGeom.mjGEOM_ARROW), int(mujoco.mjtGeom.mjGEOM_TRIANGLE)
_SOLID = {
    MarkerType.CUBE: _BOX,
    MarkerType.CUBE_LIST: _BOX,
    MarkerType.SPHERE: _ELLIPSOID,
    MarkerType.SPHERE_LIST: _ELLIPSOID,
    MarkerType.CYLINDER: int(mujoco.mjtGeom.mjGEOM_CYLINDER),
}


def _colors(marker: ShownMarker, count: int) -> NDArray[np.float32]:
    """Return a colour for each of `count` points, shape (count, 4)."""
    return marker.colors if len(marker.colors) else np.broadcast_to(marker.color, (count, 4))


def _facing_axes(camera: Vector) -> Vector:
    """Return the axes right, up and towards the camera, shape (3, 3)."""
    return camera[:3, :3] * [1.0, -1.0, -1.0]


def _rod_solids(
    starts: Vector, ends: Vector, radius: float, colors: NDArray[np.float32], kind: int
) -> Iterator[Solid]:
    """Yield arrows, or bars for lines, between points, shape (n, 3)."""
    ways = ends - starts
    lengths = np.linalg.norm(ways, axis=1)
    turns = _along(ways, lengths)
    if kind == _ARROW:
        places, halves, emission = starts, lengths, _LIT
    else:
        # half a thickness longer at either end, so that bars which meet leave no gap
        places, halves, emission = 0.5 * (starts + ends), 0.5 * lengths + radius, _FLAT
    sizes = np.column_stack([np.full((len(ways), 2), radius), halves])
    for size, place, turn, color in zip(sizes, places, turns, colors, strict=False):
        yield Solid(kind, size, place, turn, color, emission)


def _along(ways: Vector, lengths: Vector) -> Vector:
    """Return axes whose z is along each of `ways`, shape (n, 3, 3)."""
    z = np.where(lengths[:, None] > 0.0, ways / np.maximum(lengths, _TINY)[:, None], [0.0, 0.0, 1.0])
    aside = np.where(np.abs(z[:, 1:2]) < 0.9, [0.0, 1.0, 0.0], [1.0, 0.0, 0.0])
    x = np.cross(aside, z)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=2)


def _triangles(corners: Vector, marker: ShownMarker) -> Iterator[Solid]:
    colors = _colors(marker, len(corners) // 3)
    if len(colors) == len(corners):
        colors = colors.reshape(-1, 3, 4).mean(axis=1, dtype=np.float32)
    for (a, b, c), color in zip(corners.reshape(-1, 3, 3), colors, strict=True):
        normal = np.cross(b - a, c - a)
        if (area := float(np.linalg.norm(normal))) == 0.0:
            continue
        size = np.array([np.linalg.norm(b - a), np.linalg.norm(c - a), 1.0])
        turn = np.column_stack([(b - a) / size[0], (c - a) / size[1], normal / area])
        yield Solid(_TRIANGLE, size, a, turn, color)


def _text(marker: ShownMarker, position: Vector, facing: Vector) -> Iterator[Solid]:
    height = float(marker.scale[2])
    strokes, thick = segments(marker.text, height), 0.5 * STROKE * height
    ways = strokes[:, 1] - strokes[:, 0]
    lengths = np.linalg.norm(ways, axis=1)
    x, y = np.where(lengths[:, None] > 0.0, ways / np.maximum(lengths, _TINY)[:, None], [1.0, 0.0]).T
    right, up, near = facing.T
    # axes of each stroke as columns: along it, across it, towards the camera
    turns = np.stack(
        [
            np.outer(x, right) + np.outer(y, up),
            np.outer(x, up) - np.outer(y, right),
            np.tile(near, (len(x), 1)),
        ],
        axis=2,
    )
    places = position + strokes.mean(axis=1) @ facing[:, :2].T
    for length, place, turn in zip(lengths, places, turns, strict=True):
        size = np.array([0.5 * length + thick, thick, 0.2 * thick])
        yield Solid(_BOX, size, place, turn, marker.color, _FLAT)
