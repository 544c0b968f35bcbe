"""White discs on a red ground: where they are in a picture. Nothing is learned, nothing is clicked.

A disc is seen as an ellipse. A white spot is one if its area is that of the ellipse with its second moments,
if it is evenly bright, and if red is around it; so paper, light reflexes and grey instruments are none, nor
is a disc covered in part or cut by the edge of the picture.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from schemas.vectors import Vector

__all__ = ["find_blobs"]

_LEAST_AREA = 30
"""px: a disc of 25 mm is that small at 1.3 m."""
_MOST = 6
"""Blobs considered, the largest ones; more make too many quadruples."""
_BRIGHT, _GREY = 60, 0.75
"""White: at least so bright (of 255), with the weakest of the three colours at least this share of the
strongest.
"""
_RED = 1.6
"""Red: stronger than the other two by this factor."""
_ELLIPSE = 0.035
"""Greatest difference between the area of a spot and that of its ellipse, as a share: that of a rectangle is
pi/3 - 1 = 0.047.
"""
_EVEN = 0.75
"""Least brightness inside a spot as a share of its median: less is something before it."""
_RING = (2, 5)
"""Ring around a spot, examined for its ground, px from the spot."""


def find_blobs(cv2: Any, picture: NDArray[np.uint8]) -> Vector:
    """Return the centres of the discs in `picture` (RGB), shape (n, 2), px (x right, y down), largest first.

    They are centroids of the discs' pixels, each weighted by how white it is, so finer than a pixel.
    """
    weakest, strongest = picture.min(axis=2), picture.max(axis=2)
    white = ((strongest >= _BRIGHT) & (weakest >= _GREY * strongest)).astype(np.uint8)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(white, connectivity=8)
    order = sorted(range(1, len(stats)), key=lambda i: (-int(stats[i, 4]), i))
    found = [
        centre
        for label in order
        if stats[label, 4] >= _LEAST_AREA
        if (centre := _centre(cv2, picture, weakest, labels, label, stats[label])) is not None
    ]
    return np.array(found[:_MOST]).reshape(-1, 2)


def _centre(
    cv2: Any, picture: NDArray[np.uint8], weakest: NDArray[np.uint8], labels: Any, label: int, stats: Any
) -> Vector | None:
    """Return the centre of one spot, shape (2,), px, or None if it is no disc on red."""
    left, top, width, height, area = (int(number) for number in stats)
    margin = _RING[1]
    rows, columns = picture.shape[:2]
    if left < margin or top < margin or left + width > columns - margin or top + height > rows - margin:
        return None
    part = np.s_[top - margin : top + height + margin, left - margin : left + width + margin]
    spot = (labels[part] == label).astype(np.uint8)
    moments = cv2.moments(spot, binaryImage=True)
    xx, yy, xy = (moments[name] / area for name in ("mu20", "mu02", "mu11"))
    pixel = 1.0 / 12.0  # of a pixel's own second moment
    ellipse = 4.0 * np.pi * np.sqrt(max(0.0, (xx + pixel) * (yy + pixel) - xy * xy))
    if abs(ellipse / area - 1.0) > _ELLIPSE:
        return None
    bright = float(np.median(weakest[part][spot > 0]))
    inside = cv2.erode(spot, np.ones((3, 3), np.uint8)) > 0
    if inside.any() and float(weakest[part][inside].min()) < _EVEN * bright:
        return None
    near, far = (cv2.dilate(spot, np.ones((2 * n + 1, 2 * n + 1), np.uint8)) for n in _RING)
    ring = picture[part][(far > near)].astype(float)  # (k, 3)
    if np.mean(ring[:, 0] > _RED * ring[:, 1:].max(axis=1)) < 0.9:
        return None
    dark = float(np.median(ring.min(axis=1)))
    weight = np.clip((weakest[part] - dark) / max(bright - dark, 1.0), 0.0, 1.0) * (near > 0)
    soft = cv2.moments(weight)
    return np.array([soft["m10"], soft["m01"]]) / soft["m00"] + (left - margin, top - margin)
