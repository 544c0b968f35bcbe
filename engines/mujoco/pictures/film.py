"""A film of a recording: pictures with title and time, as H.264 in an MP4 file."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

__all__ = ["Caption", "write_film"]

_CODEC, _PIXELS = "libx264", "yuv420p"
_OPTIONS = {"crf": "20", "preset": "medium", "movflags": "+faststart"}
"""Quality at which no compression is seen, and an index at the beginning: pages play it while it loads."""


class Caption:
    """Title and time along the lower edge of a picture."""

    def __init__(self, title: str, height: int) -> None:
        """`height`: of the picture, pixels."""
        self._title, self._margin = title, max(height // 40, 4)
        self._font = ImageFont.load_default(max(height // 24, 9))

    def add(self, picture: NDArray[np.uint8], time_s: float) -> NDArray[np.uint8]:
        """Return a copy of a picture, shape (height, width, 3), RGB, with the caption."""
        image = Image.fromarray(picture)
        draw = ImageDraw.Draw(image)
        width, height = image.size
        below = height - self._margin
        for text, at, anchor in (
            (self._title, (self._margin, below), "ls"),
            (f"{time_s:.1f} s", (width - self._margin, below), "rs"),
        ):
            draw.text(at, text, "white", self._font, anchor, stroke_width=1, stroke_fill="black")
        return np.asarray(image)


def write_film(file: Path, pictures: Iterable[NDArray[np.uint8]], size: tuple[int, int], fps: int) -> int:
    """Write pictures, shape (height, width, 3), RGB, as a film; return their number.

    `size`: width and height, pixels, both even. Raises OSError if the file cannot be written.
    """
    import av

    number = 0
    with av.open(str(file), "w", options={"movflags": _OPTIONS["movflags"]}) as container:
        stream: Any = container.add_stream(_CODEC, rate=fps, options=_OPTIONS)
        (stream.width, stream.height), stream.pix_fmt = size, _PIXELS
        for picture in pictures:
            frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
            frame.pts, frame.time_base = number, Fraction(1, fps)
            container.mux(stream.encode(frame))
            number += 1
        container.mux(stream.encode())
    return number
