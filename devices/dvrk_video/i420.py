"""Pictures in I420, as the dVRK's sources send: a plane of luma, then two of chroma at half the size."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["COLORIMETRY", "to_i420"]

COLORIMETRY = "bt601"
"""Colours by ITU-R BT.601 with a reduced range, in GStreamer's words."""

_LUMA, _BLUE, _RED = (66, 129, 25), (-38, -74, 112), (112, -94, -18)
"""Weights of red, green and blue, in 256ths."""
_BLACK, _GREY = 16, 128


def to_i420(pixels: NDArray[np.uint8]) -> bytes:
    """Return the planes of a picture, shape (height, width, 3), RGB, rows padded to four bytes."""
    odd = pixels.shape[0] % 2, pixels.shape[1] % 2
    even = np.pad(pixels, ((0, odd[0]), (0, odd[1]), (0, 0)), "edge") if any(odd) else pixels
    colours = [even[..., i].astype(np.uint16) for i in range(3)]  # 16 bits hold the weighted sum
    quads = [
        (one[::2, ::2] + one[1::2, ::2] + one[::2, 1::2] + one[1::2, 1::2]).astype(np.int32)
        for one in colours
    ]
    luma = (_weighted(colours, _LUMA) + np.uint16(128) >> 8) + _BLACK
    chroma = ((_weighted(quads, weights) + 512 >> 10) + _GREY for weights in (_BLUE, _RED))
    return b"".join(_padded_rows(plane) for plane in (luma, *chroma))


def _weighted(colours: list[NDArray[Any]], weights: tuple[int, int, int]) -> NDArray[Any]:
    return weights[0] * colours[0] + weights[1] * colours[1] + weights[2] * colours[2]


def _padded_rows(plane: NDArray[Any]) -> bytes:
    levels = plane.astype(np.uint8)
    return (np.pad(levels, ((0, 0), (0, -levels.shape[1] % 4))) if levels.shape[1] % 4 else levels).tobytes()
