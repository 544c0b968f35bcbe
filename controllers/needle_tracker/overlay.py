"""The left picture with what the tracker sees: its region, the wire that it took, and its estimate."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from controllers.needle_tracker.arc_fit import Arc, Detection
from controllers.needle_tracker.segmentation import Region
from schemas.vectors import Vector

__all__ = ["draw_overlay"]

_REGION, _WIRE, _TIP, _ESTIMATE, _AXIS = (
    (250, 220, 60),
    (255, 120, 255),
    (255, 255, 255),
    (255, 60, 40),
    (60, 230, 255),
)
_FINE = 4
"""Binary digits behind the point of OpenCV's coordinates."""


def draw_overlay(
    cv2: Any,
    picture: NDArray[np.uint8],
    region: Region | None,
    seen: Detection | None,
    arc: Arc,
    projection: Vector,
    pose: Vector,
) -> NDArray[np.uint8]:
    """Return a copy of `picture` (RGB) with all of it: red is the estimate, cyan the needle's normal.

    `projection`, shape (3, 4), is from the frame in which the needle has `pose`, shape (4, 4), to pixels.
    """
    image = picture.copy()
    if region is not None:
        cv2.rectangle(image, (region.left, region.top), (region.right - 1, region.bottom - 1), _REGION, 1)
    if seen is not None:
        columns, rows = np.round(seen.points).astype(int).T
        image[rows.clip(0, len(image) - 1), columns.clip(0, image.shape[1] - 1)] = _WIRE
        for x, y in seen.tips.tolist():
            cv2.circle(image, (round(x), round(y)), 6, _TIP, 1, cv2.LINE_AA)
    line, _, depth = arc.project_line(projection, pose)
    if depth > 0.0:
        centre = projection @ [*pose[:3, 3], 1.0]
        ahead = projection @ [*(pose[:3, 3] + 0.5 * arc.needle.radius * pose[:3, 2]), 1.0]
        _line(cv2, image, line, _ESTIMATE)
        _line(cv2, image, np.array([centre[:2] / centre[2], ahead[:2] / ahead[2]]), _AXIS)
        x, y = line[-1].tolist()
        cv2.drawMarker(image, (round(x), round(y)), _ESTIMATE, cv2.MARKER_CROSS, 7, 1)
    return image


def _line(cv2: Any, image: NDArray[np.uint8], points: Vector, colour: tuple[int, int, int]) -> None:
    corners = np.round(points * 2**_FINE).astype(np.int32)
    cv2.polylines(image, [corners], False, colour, 1, cv2.LINE_AA, _FINE)
