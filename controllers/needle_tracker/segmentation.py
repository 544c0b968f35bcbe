"""The needle's colours in a picture: green wire and blue tip, near the gripper."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from controllers.needle_tracker.arc_fit import Detection
from schemas.vectors import Vector

__all__ = ["Region", "detect_needle", "region_about"]

_STRONGER = 1.35
"""A pixel is green, or blue, where that colour is stronger than both others by this factor,"""
_LEAST = 12
"""and above them by this (of 255): in the dark there is no colour."""
_FULL, _OF_FULL = 80.0, 0.4
"""Percentile of the excess over the other colours, and the share of it from which on a pixel counts whole.

A wire is brighter on the side of the lamp: were pixels weighted by all of their colour, its middle would move
there. Only those at its edges, which it fills in part, count less.
"""
_POINTS = 2500
"""Pixels of the wire used; of more, every second or third."""
_TIP_AREA = 2
"""px: a smaller spot is no tip."""


class Region(NamedTuple):
    """The part of a picture looked at, px: columns and rows from the first ones up to the last."""

    left: int
    top: int
    right: int
    bottom: int


def region_about(projection: Vector, point: Vector, radius: float, width: int, height: int) -> Region | None:
    """Return the square about the image of a sphere; None where it is outside of the picture.

    Args:
        projection: from the frame of `point` to pixels, shape (3, 4).
        point: the sphere's centre, shape (3,), m.
        radius: of the sphere, m.
        width: of the picture, px.
        height: of the picture, px.
    """
    x, y, depth = (projection[:, :3] @ point + projection[:, 3]).tolist()
    if depth <= radius:
        return None
    across = projection[0, :3] - x / depth * projection[2, :3]  # the focal length, whatever the frame
    reach = float(np.linalg.norm(across)) * radius / np.sqrt(depth * depth - radius * radius)
    left, top = max(0, int(x / depth - reach)), max(0, int(y / depth - reach))
    right, bottom = min(width, int(x / depth + reach) + 1), min(height, int(y / depth + reach) + 1)
    return Region(left, top, right, bottom) if left < right and top < bottom else None


def detect_needle(cv2: Any, picture: NDArray[np.uint8], region: Region, wire_px: float) -> Detection:
    """Return what is seen of the needle in `region` of `picture` (RGB), in pixels of the whole picture.

    `wire_px`: width of the wire as it is seen about there, px.
    """
    part = picture[region.top : region.bottom, region.left : region.right].astype(np.float32)
    red, green, blue = cv2.split(part)
    corner = np.array([region.left, region.top], np.float64)
    rows, columns, share = _of_colour(green, np.maximum(red, blue))
    every = 1 + len(rows) // _POINTS
    points = np.stack([columns, rows], axis=1)[::every] + corner
    lengths = share[::every] * every / max(wire_px, 1.0)
    return Detection(points, lengths, _colour_spots(cv2, blue, np.maximum(red, green)) + corner)


def _of_colour(colour: Any, others: Any) -> tuple[Vector, Vector, Vector]:
    """Return rows and columns of the pixels that have a colour, and which share of each has it, (n,)."""
    excess = colour - others
    rows, columns = np.nonzero((colour > _STRONGER * others) & (excess >= _LEAST))
    found = excess[rows, columns].astype(np.float64)
    full = _OF_FULL * float(np.percentile(found, _FULL)) if found.size else 1.0
    return rows.astype(np.float64), columns.astype(np.float64), np.minimum(1.0, found / full)


def _colour_spots(cv2: Any, colour: Any, others: Any) -> Vector:
    """Return the centres of the spots that have a colour, shape (k, 2)."""
    excess = np.maximum(colour - others, 0.0)
    mask = ((colour > _STRONGER * others) & (excess >= _LEAST)).astype(np.uint8)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    centres: list[Vector] = []
    for label in range(1, count):
        if stats[label, 4] >= _TIP_AREA:
            rows, columns = np.nonzero(labels == label)
            weights = excess[rows, columns].astype(np.float64)
            centres.append(np.array([weights @ columns, weights @ rows]) / weights.sum())
    return np.array(centres).reshape(-1, 2)
