"""Rays through the pixels of a camera, and pixels of points: a pinhole, or a lens with distortion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engines.mujoco.pictures.lens import NO_DISTORTION, Distortion, Lens, distort_points, undistort_points
from robots.dvrk.endoscope import StereoCamera
from schemas.vectors import Vector

__all__ = ["Projection"]

_FINER, _MOST_PIXELS = 3, 8192
"""Pixels drawn for each one of a distorted picture, along either side, and the largest drawn picture."""


class Projection:
    """The camera of either eye.

    With distortion a pinhole of a larger angle and finer pixels is drawn, and each pixel takes the triangle
    that is there; the point on the triangle is where the pixel's own ray meets it.
    """

    def __init__(self, camera: StereoCamera, distortion: Distortion = NO_DISTORTION) -> None:
        self.intrinsics, self.distortion = camera.intrinsics(), distortion
        """Camera matrix K, shape (3, 3), and k1, k2, p1, p2, k3."""
        self.size = camera.width, camera.height
        """Width and height, pixels."""
        u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
        plane = (np.stack([u, v], axis=-1).reshape(-1, 2) - self.intrinsics[:2, 2]) / camera.focal_length
        self.drawn_size, self.drawn_intrinsics = self.size, self.intrinsics
        """Size and camera matrix of the drawn pinhole picture."""
        self._index: NDArray[np.int64] | None = None
        if distortion != NO_DISTORTION:
            plane = undistort_points(plane, distortion)
            drawn = Lens(camera, distortion).drawn
            finer = max(1, min(_FINER, _MOST_PIXELS // max(drawn.width, drawn.height)))
            fine = StereoCamera(finer * drawn.width, finer * drawn.height, drawn.field_of_view)
            self.drawn_size, self.drawn_intrinsics = (fine.width, fine.height), fine.intrinsics()
            places = np.rint(plane * fine.focal_length + self.drawn_intrinsics[:2, 2]).astype(np.int64)
            places = places.clip(0, [fine.width - 1, fine.height - 1])
            self._index = (places[:, 1] * fine.width + places[:, 0]).reshape(camera.height, camera.width)
        rays = np.concatenate([plane, np.ones((len(plane), 1))], axis=1)
        self.rays = rays.reshape(camera.height, camera.width, 3)
        """Ray through the middle of each pixel, in the optical frame, z is 1, shape (height, width, 3)."""

    def pick(self, drawn: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return what each pixel shows, shape (height, width), of a drawn picture."""
        return drawn if self._index is None else drawn.ravel()[self._index]

    def project(self, points: Vector) -> Vector:
        """Return pixels (u right, v down), shape (n, 2), of points in the optical frame, shape (n, 3), m."""
        plane = points[:, :2] / points[:, 2:]
        if self.distortion != NO_DISTORTION:
            plane = distort_points(plane, self.distortion)
        return plane * [self.intrinsics[0, 0], self.intrinsics[1, 1]] + self.intrinsics[:2, 2]
