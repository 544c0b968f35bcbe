"""Truth of one picture: the surface point behind each pixel, and all that follows from it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from engines.mujoco.truth.projection import Projection
from engines.mujoco.truth.surfaces import Surfaces
from schemas.vectors import Vector

__all__ = ["Motion", "Sight", "Viewpoint"]

T = TypeVar("T", bound=np.generic)

_OCCLUDED_M = 1e-3
"""A point is hidden if something is seen nearer than it by more than this, m."""


@dataclass(frozen=True)
class Viewpoint:
    """A camera at an instant."""

    pose: Vector
    """Optical frame (x right, y down, z ahead) in the world, shape (4, 4)."""
    projection: Projection

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, pixels."""
        return self.projection.size

    def to_camera(self, points: Vector) -> Vector:
        """Return points, shape (n, 3), m, frame `world`, in the optical frame."""
        return (points - self.pose[:3, 3]) @ self.pose[:3, :3]


@dataclass(frozen=True)
class Motion:
    """Motion of the seen surface points until another instant."""

    flow: NDArray[np.float32]
    """Displacement in the picture, px, shape (height, width, 2); NaN on the background and where the point
    comes behind the camera.
    """
    scene_flow: NDArray[np.float32]
    """Displacement in the world, m, along the axes of the optical frame of the first instant, shape (height,
    width, 3); NaN on the background.
    """
    is_visible: NDArray[np.bool_]
    """Whether the point is seen in the later picture too, shape (height, width)."""


class Sight:
    """The surface points that a camera sees."""

    def __init__(
        self, surfaces: Surfaces, vertices: Vector, view: Viewpoint, triangles: NDArray[np.int64]
    ) -> None:
        """Find the point behind each pixel.

        Args:
            surfaces: triangles of the scene.
            vertices: of the triangles, shape (v, 3), m, frame `world`.
            view: the camera.
            triangles: number of the seen triangle of each pixel, shape (height, width); -1: background.
        """
        self.view, self._surfaces, self._vertices = view, surfaces, vertices
        self.hit = triangles >= 0
        """Pixels that show a surface, shape (height, width)."""
        self.triangles = triangles[self.hit]
        """Number of the triangle of each such pixel, shape (n,)."""
        self._corners = surfaces.faces[self.triangles]  # (n, 3)
        local = view.to_camera(vertices)[self._corners]  # (n, 3, 3)
        self.weights = _barycentric(local, view.projection.rays[self.hit])
        """Shares of the triangle's corners in the point, shape (n, 3)."""
        self.points = np.einsum("ni,nij->nj", self.weights, local)
        """Points in the optical frame, shape (n, 3), m."""

    @cached_property
    def depth(self) -> NDArray[np.float32]:
        """Distance along the optical axis, m, shape (height, width); 0 on the background."""
        return self._picture(self.points[:, 2].astype(np.float32), 0)

    @property
    def bodies(self) -> NDArray[np.uint16]:
        """Number of the body in each pixel, shape (height, width); 0 on the background."""
        return self._picture(self._surfaces.bodies[self.triangles], 0)

    @property
    def classes(self) -> NDArray[np.uint16]:
        """`SceneClass` in each pixel, shape (height, width); a visible film has the class of its liquid."""
        found = self._surfaces.classes[self.triangles].copy()
        thickness, liquid = self._surfaces.wet_faces()
        is_wet = np.einsum("ni,ni->n", self.weights, thickness[self.triangles]) >= 1.0
        found[is_wet] = liquid[self.triangles[is_wet]]
        return self._picture(found, 0)

    @property
    def normals(self) -> NDArray[np.float32]:
        """Unit normals of the triangles in the optical frame, shape (height, width, 3); 0: background."""
        a, b, c = self._vertices[self._corners].swapaxes(0, 1)
        normals = np.cross(b - a, c - a) @ self.view.pose[:3, :3]
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(np.float64).tiny)
        return self._picture(normals.astype(np.float32), 0)

    def motion(self, later: Vector, view: Viewpoint, sight: Sight) -> Motion:
        """Return the motion of the points until another instant.

        Args:
            later: the same vertices then, shape (v, 3), m, frame `world`.
            view: the camera then.
            sight: what it sees then.
        """
        moved = np.einsum("ni,nij->nj", self.weights, later[self._corners])
        before = np.einsum("ni,nij->nj", self.weights, self._vertices[self._corners])
        scene_flow = (moved - before) @ self.view.pose[:3, :3]
        local = view.to_camera(moved)
        flow = np.full((len(local), 2), np.nan)
        ahead = local[:, 2] > 0.0
        to = view.projection.project(local[ahead])
        flow[ahead] = to - self.view.projection.project(self.points[ahead])
        is_visible = np.zeros(len(local), np.bool_)
        is_visible[ahead] = sight.sees(to, local[ahead, 2])
        return Motion(
            self._picture(flow.astype(np.float32), np.nan),
            self._picture(scene_flow.astype(np.float32), np.nan),
            self._picture(is_visible, False),
        )

    def sees(self, pixels: Vector, depth: Vector) -> NDArray[np.bool_]:
        """Return whether points at `pixels`, shape (n, 2), and `depth`, shape (n,), m, are seen."""
        width, height = self.view.size
        columns, rows = np.rint(pixels.clip(-1.0, [width, height])).astype(np.int64).T
        inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height) & (depth > 0.0)
        found = np.zeros(len(pixels), np.bool_)
        seen = self.depth[rows[inside], columns[inside]]
        found[inside] = (seen == 0.0) | (depth[inside] < seen + _OCCLUDED_M)
        return found

    def _picture(self, values: NDArray[T], empty: float) -> NDArray[T]:
        """Return values of the pixels with a surface as a picture, `empty` elsewhere."""
        picture = np.full((*self.hit.shape, *values.shape[1:]), empty, values.dtype)
        picture[self.hit] = values
        return picture


def _barycentric(corners: Vector, rays: Vector) -> Vector:
    """Return where rays from the origin, shape (n, 3), meet triangles, shape (n, 3, 3), as shares, (n, 3).

    A ray that passes a triangle, by up to a fraction of a pixel where OpenGL rounds, meets its edge.
    """
    a, b, c = corners.swapaxes(0, 1)
    volumes = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)  # (n, 3, 3)
    shares = np.einsum("nij,nj->ni", volumes, rays)
    shares *= np.where(shares.sum(axis=1, keepdims=True) < 0.0, -1.0, 1.0)
    shares = np.maximum(shares, 0.0)
    total = shares.sum(axis=1, keepdims=True)
    return np.divide(shares, total, out=np.full_like(shares, 1.0 / 3.0), where=total > 0.0)
