"""OpenCV, which the extra `vision` brings, for the controllers that see."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schemas.errors import MissingExtraError
from schemas.ros import Image

__all__ = ["import_opencv", "picture_pixels"]

_CHANNELS = {"rgb8": slice(None), "bgr8": slice(None, None, -1)}


def import_opencv(who: str) -> Any:
    """Return the module cv2, which then uses one thread: others of this machine step the simulation.

    Raises MissingExtraError, about `who`, where it is not installed.
    """
    if find_spec("cv2") is None:
        raise MissingExtraError(who, "vision", "opencv-python-headless")
    cv2 = import_module("cv2")
    cv2.setNumThreads(1)
    return cv2


def picture_pixels(image: Image) -> NDArray[np.uint8] | None:
    """Return the picture as rows of red, green, blue, shape (height, width, 3); None if it is no such."""
    channels = _CHANNELS.get(image.encoding)
    row = 3 * image.width
    if channels is None or not image.width or image.step < row or image.data.size < image.step * image.height:
        return None
    rows = image.data[: image.step * image.height].reshape(image.height, image.step)[:, :row]
    return np.ascontiguousarray(rows.reshape(image.height, image.width, 3)[:, :, channels])
