"""Lens distortion after Brown and Conrady, the model `plumb_bob` of ROS and OpenCV.

A renderer draws what a pinhole sees, over a larger angle; every pixel takes its colour from there.
"""

from __future__ import annotations

from math import atan, ceil, tan

import numpy as np
from numpy.typing import NDArray

from robots.dvrk.endoscope import StereoCamera
from schemas.vectors import Vector

__all__ = [
    "NO_DISTORTION",
    "Distortion",
    "Lens",
    "check_distortion",
    "distort_points",
    "undistort_points",
]

Distortion = tuple[float, float, float, float, float]
"""Coefficients k1, k2, p1, p2, k3."""
NO_DISTORTION: Distortion = (0.0, 0.0, 0.0, 0.0, 0.0)

_TURNS, _CLOSE = 100, 1e-7
"""Most iterations of the inverse, and the distance of a distorted point at which the inverse is found."""
_WIDEST = 4.0
"""Tangent of the largest angle from the axis at which a renderer draws."""


class Lens:
    """The lens of both cameras of an endoscope."""

    def __init__(self, camera: StereoCamera, distortion: Distortion) -> None:
        """Prepare for pictures of `camera`. Raises ValueError for a distortion without inverse."""
        self.drawn = camera
        """The pinhole cameras to draw with."""
        self._is_plain = distortion == NO_DISTORTION
        if self._is_plain:
            return
        width, height, focal = camera.width, camera.height, camera.focal_length
        middle = 0.5 * np.array([width - 1, height - 1])
        pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).reshape(-1, 2)
        rays = undistort_points((pixels - middle) / focal, distortion)
        outside = np.abs(rays).max(axis=0) * focal - middle
        margin = np.array([max(0, ceil(one - 1e-9)) for one in outside])
        across, down = (2 * margin + [width, height]).tolist()
        self.drawn = StereoCamera(across, down, 2.0 * atan(0.5 * across / focal), camera.baseline)
        places = rays * focal + middle + margin
        low = np.minimum(places.astype(np.int64), [across - 2, down - 2])
        self._shape, self._index = (height, width), low[:, 1] * across + low[:, 0]
        self._part = (places - low).astype(np.float32)[:, :, None]

    def distort(self, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return what the lens makes of a drawn picture, shape (drawn height, drawn width, c)."""
        if self._is_plain:
            return picture
        _, row, channels = picture.shape
        pixels = np.ascontiguousarray(picture).reshape(-1, channels)
        x, y = self._part[:, 0], self._part[:, 1]
        upper, lower = (
            (1.0 - x) * pixels[start] + x * pixels[start + 1] for start in (self._index, self._index + row)
        )
        return (
            (upper + y * (lower - upper) + np.float32(0.5)).astype(np.uint8).reshape(*self._shape, channels)
        )


def check_distortion(camera: StereoCamera, distortion: Distortion) -> None:
    """Raise ValueError for a distortion with which a part of the picture cannot be drawn."""
    x = tan(0.5 * camera.field_of_view)
    side = np.linspace(-1.0, 1.0, 33)
    one = np.ones_like(side)
    edges = np.concatenate(
        [np.stack(edge, axis=1) for edge in ((side, one), (side, -one), (one, side), (-one, side))]
    )
    undistort_points(edges * [x, x * camera.height / camera.width], distortion)


def distort_points(points: Vector, distortion: Distortion) -> Vector:
    """Return where rays through `points` of the plane z = 1, shape (n, 2), seem to come from."""
    k1, k2, p1, p2, k3 = distortion
    x, y = points.T
    square = x * x + y * y
    radial = 1.0 + square * (k1 + square * (k2 + square * k3))
    return np.stack(
        [
            x * radial + 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x),
            y * radial + p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y,
        ],
        axis=1,
    )


def undistort_points(points: Vector, distortion: Distortion) -> Vector:
    """Return the points of the plane z = 1 that seem to be at `points`, shape (n, 2).

    Raises ValueError if there are none, or if they are too far from the axis to be drawn.
    """
    found = points.copy()
    for _ in range(_TURNS):
        miss = points - distort_points(found, distortion)
        found = np.clip(found + miss, -2.0 * _WIDEST, 2.0 * _WIDEST)
        if np.abs(miss).max() < _CLOSE:
            break
    else:
        raise ValueError("no ray leads to a part of the picture: the distortion is too strong")
    if np.abs(found).max() > _WIDEST:
        raise ValueError(
            f"a ray leaves the axis by more than {atan(_WIDEST):.2f} rad: the distortion is too strong"
        )
    return found
