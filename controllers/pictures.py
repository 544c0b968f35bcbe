"""The base of controllers that see: OpenCV, pictures that match their camera_info, warnings."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from controllers.opencv import import_opencv, picture_pixels
from hub.participant import Controller
from schemas.ros import Image, StringMessage

__all__ = ["PictureController"]


class PictureController(Controller):
    """Steps with the newest pictures of a camera; `max_age` (ns) is a parameter."""

    kind: ClassVar[str]
    """Name of the kind, for error messages."""

    def __init__(self, name: str, params: Any) -> None:
        super().__init__(name, params)
        self._warnings: list[StringMessage] = []
        self._cv2: Any = None

    def _load_opencv(self) -> None:
        """Import OpenCV. Raises MissingExtraError where it is not installed."""
        self._cv2 = import_opencv(f"participant '{self.name}' (kind {self.kind})")

    def _warn(self, text: str) -> None:
        self._warnings.append(StringMessage(data=text))

    def _accepted_pixels(self, image: Image, width: float, height: float) -> NDArray[np.uint8] | None:
        """Return rows of red, green, blue, shape (height, width, 3); warn of a picture of another size."""
        picture = picture_pixels(image)
        if picture is not None and picture.shape[:2] == (height, width):
            return picture
        self._warn(
            f"a picture of {image.width} x {image.height} ({image.encoding}) is refused: camera_info states"
            f" {width:g} x {height:g}, and rgb8 or bgr8 is needed"
        )
        return None

    def _is_blind(self, t: int, picture_ns: int) -> bool:
        """Return whether the newest picture, stamped `picture_ns` (-1: none), is too old at `t` (ns)."""
        return picture_ns < 0 or t - picture_ns > self.params.max_age
