"""Markers of augmented reality in a frame: the visible part, as arrays, without names.

    u32 bytes of the text, text (JSON), spaces to a multiple of 4, then f32 numbers of all n markers: poses in
    their frames (n, 7), sizes (n, 3), colours (n, 4), points (m, 3), colours of points (k, 4)

The text has for each marker `type`, `frame`, `text`, and the numbers of `points` and `colours` of points.
Metres, quaternions (x, y, z, w), red, green, blue and opacity from 0 to 1.
"""

from __future__ import annotations

import json
import struct

from schemas.errors import MessageError
from schemas.trocar_msgs import ShownMarkers

__all__ = ["marker_content"]

_LENGTH = struct.Struct("<I")


def marker_content(shown: ShownMarkers) -> bytes:
    """Return a message as content of a frame; raises MessageError if the parts do not fit together."""
    count, points, colours = len(shown.types), int(shown.point_counts.sum()), int(shown.color_counts.sum())
    lists = shown.frames, shown.texts, shown.point_counts, shown.color_counts
    numbers = (shown.poses, shown.scales_m, shown.colors, shown.points_m, shown.point_colors)
    sizes = (7 * count, 3 * count, 4 * count, 3 * points, 4 * colours)
    if any(len(one) != count for one in lists) or any(
        one.size != size for one, size in zip(numbers, sizes, strict=True)
    ):
        raise MessageError(f"{ShownMarkers.ros_type}: {count} markers, but its parts have other sizes")
    rows = [
        {"type": type_, "frame": frame, "text": text, "points": own, "colours": coloured}
        for type_, frame, text, own, coloured in zip(
            shown.types.tolist(),
            shown.frames,
            shown.texts,
            shown.point_counts.tolist(),
            shown.color_counts.tolist(),
            strict=True,
        )
    ]
    text = json.dumps(rows, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    return b"".join([_LENGTH.pack(len(text)), text, *(one.astype("<f4").tobytes() for one in numbers)])
