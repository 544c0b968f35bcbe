"""Ten surfaces as scanners, segmentations and modelling programs leave them, made by code."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["UGLY", "Surface", "ellipsoid", "write_stl"]

Indices = NDArray[np.int64]
Points = NDArray[np.float64]


class Surface(NamedTuple):
    """Triangles."""

    vertices: Points
    """Shape (n, 3), m."""
    triangles: Indices
    """Shape (f, 3)."""


def ellipsoid(
    axes: tuple[float, float, float] = (0.05, 0.035, 0.025),
    middle: tuple[float, float, float] = (0.0, 0.0, 0.0),
    halvings: int = 3,
) -> Surface:
    """Return an octahedron with `halvings` subdivisions, as a closed ellipsoid; lengths in m."""
    vertices = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], np.float64)
    triangles = np.array(
        [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]]
    )
    for _ in range(halvings):
        corners = vertices[triangles]  # (f, 3, 3)
        middles = 0.5 * (corners + np.roll(corners, -1, axis=1))
        a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
        ab, bc, ca = middles[:, 0], middles[:, 1], middles[:, 2]
        soup = np.concatenate(
            [np.stack(three, axis=1) for three in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        ).reshape(-1, 3)
        soup /= np.linalg.norm(soup, axis=1, keepdims=True)
        _, first, numbers = np.unique(np.round(soup, 9), axis=0, return_index=True, return_inverse=True)
        vertices, triangles = soup[first], numbers.reshape(-1, 3)
    return Surface(vertices * axes + middle, triangles)


def voxels(filled: NDArray[np.bool_], edge: float) -> Surface:
    """Return the outer faces of cubes of `edge` (m) where `filled`, shape (i, j, k)."""
    padded = np.pad(filled, 1)
    corners: list[Points] = []
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 0], [1, 1], [0, 1]])
    for axis, side in product(range(3), (0, 1)):
        outer = padded & ~np.roll(padded, 1 - 2 * side, axis)
        cells = np.argwhere(outer) - 1
        face = np.insert(square if side else square[::-1], axis, side, axis=1)
        if axis == 1:
            face = face[::-1]
        corners.append((cells[:, None] + face).reshape(-1, 3))
    vertices, numbers = np.unique(np.concatenate(corners), axis=0, return_inverse=True)
    return Surface(vertices * edge, numbers.reshape(-1, 3))


def joined(*surfaces: Surface) -> Surface:
    """Return all triangles as one surface."""
    starts = np.cumsum([0] + [len(surface.vertices) for surface in surfaces])
    return Surface(
        np.concatenate([surface.vertices for surface in surfaces]),
        np.concatenate([s.triangles + start for s, start in zip(surfaces, starts, strict=False)]),
    )


def holes() -> Surface:
    """One triangle of 20 is missing, and a patch of 12 mm."""
    vertices, triangles = ellipsoid()
    middles = vertices[triangles].mean(axis=1)
    patch = np.linalg.norm(middles - [0.0, 0.0, 0.025], axis=1) < 0.006
    kept = (np.random.default_rng(0).random(len(triangles)) > 0.05) & ~patch
    return Surface(vertices, triangles[kept])


def self_intersection() -> Surface:
    """Two ellipsoids run through each other."""
    return joined(ellipsoid(), ellipsoid(middle=(0.035, 0.012, 0.008)))


def duplicate_vertices() -> Surface:
    """Each triangle has vertices of its own, rounded to 32 bits and up to a micrometre apart, as in STL."""
    vertices, triangles = ellipsoid()
    soup = vertices[triangles].reshape(-1, 3)
    soup = soup + np.random.default_rng(0).uniform(-1e-6, 1e-6, soup.shape)
    return Surface(soup.astype(np.float32).astype(np.float64), np.arange(len(soup)).reshape(-1, 3))


def inverted_normals() -> Surface:
    """Every third triangle is turned inside out."""
    vertices, triangles = ellipsoid()
    turned = triangles.copy()
    turned[::3] = turned[::3, ::-1]
    return Surface(vertices, turned)


def thin_sheet() -> Surface:
    """A mesentery: 80 x 60 mm, 1.5 mm thick."""
    vertices, triangles = voxels(np.ones((16, 12, 1), np.bool_), 0.005)
    return Surface(vertices * [1.0, 1.0, 0.3], triangles)


def high_genus() -> Surface:
    """A plate with nine holes, in voxels of 4 mm."""
    filled = np.ones((20, 20, 4), np.bool_)
    for i, j in product((3, 9, 15), repeat=2):
        filled[i : i + 2, j : j + 2] = False
    return voxels(filled, 0.004)


def two_parts() -> Surface:
    """Two kidneys in one file."""
    return joined(ellipsoid(middle=(-0.06, 0.0, 0.0)), ellipsoid(middle=(0.06, 0.0, 0.0)))


def millimetres() -> Surface:
    """A sound surface far from the origin, whose numbers are millimetres, as of a CT."""
    vertices, triangles = ellipsoid()
    return Surface(1e3 * (vertices + np.array([0.12, -0.24, 1.1])), triangles)


def slivers() -> Surface:
    """A capped cylinder of triangles a hundred times as long as broad, with some of no area at all."""
    turns = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    ring = np.stack([0.02 * np.cos(turns), 0.02 * np.sin(turns)], axis=1)
    low, high = (np.insert(ring, 2, height, axis=1) for height in (0.0, 0.05))
    vertices = np.concatenate([low, high, [[0.0, 0.0, 0.0], [0.0, 0.0, 0.05]]])
    i, n = np.arange(400), 400
    j = (i + 1) % n
    sides = [np.stack(t, axis=1) for t in ((i, j, n + j), (i, n + j, n + i))]
    caps = [np.stack([j, i, np.full(n, 2 * n)], axis=1), np.stack([n + i, n + j, np.full(n, 2 * n + 1)], 1)]
    flat = np.stack([i, i, j], axis=1)[::10]
    return Surface(vertices, np.concatenate([*sides, *caps, flat]))


def open_disc() -> Surface:
    """A flat disc without an inside."""
    turns = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    rim = np.stack([0.04 * np.cos(turns), 0.04 * np.sin(turns), np.zeros(60)], axis=1)
    i = np.arange(60)
    return Surface(np.vstack([rim, [[0.0, 0.0, 0.0]]]), np.stack([i, (i + 1) % 60, np.full(60, 60)], axis=1))


UGLY: dict[str, Callable[[], Surface]] = {
    make.__name__: make
    for make in (
        holes,
        self_intersection,
        duplicate_vertices,
        inverted_normals,
        thin_sheet,
        high_genus,
        two_parts,
        millimetres,
        slivers,
        open_disc,
    )
}


def write_stl(surface: Surface) -> bytes:
    """Return the surface as a binary STL file."""
    record = np.zeros(len(surface.triangles), np.dtype([("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")]))
    record["v"] = surface.vertices[surface.triangles]
    return b"\0" * 80 + np.uint32(len(record)).tobytes() + record.tobytes()
