"""A stereo camera of a session, as seen by a program."""

from __future__ import annotations

from io import BytesIO
from time import monotonic

import numpy as np
from numpy.typing import NDArray

from devices.programs.connection import Connection
from devices.programs.values import Picture
from schemas.codec import decode
from schemas.errors import ConnectError, MessageError, MissingExtraError
from schemas.ros import CompressedImage, Image

__all__ = ["Camera"]

_ANSWER_S = 10.0
"""Longest wait for a picture: without a GPU some are slow to draw."""
_MAX_AGE_S = 1.0


class Camera:
    """A stereo camera; its pictures are sent to this program from the first use of each eye on."""

    def __init__(self, connection: Connection, name: str) -> None:
        self.name = name
        """Name of the camera: `endoscope`."""
        self._eyes = {eye: _Eye(connection, f"/{name}/{eye}/image_raw") for eye in ("left", "right")}

    def left(self, timeout_s: float = _ANSWER_S) -> Picture:
        """Return the newest picture of the left camera, at most a second old; wait if there is none.

        Raises ConnectError after `timeout_s`, SessionError if the session ends.
        """
        return self._eyes["left"].newest(timeout_s)

    def right(self, timeout_s: float = _ANSWER_S) -> Picture:
        """Return the newest picture of the right camera, as of `left`."""
        return self._eyes["right"].newest(timeout_s)


class _Eye:
    """Pictures of one eye, raw or compressed, whichever the session draws."""

    def __init__(self, connection: Connection, topic: str) -> None:
        self._connection, self._topic = connection, topic
        self._listening = False
        self._newest: tuple[type[Image | CompressedImage], bytes, float] | None = None

    def newest(self, timeout_s: float) -> Picture:
        if not self._listening:
            self._listening = True
            self._connection.listen(self._topic, lambda payload: self._receive(Image, payload))
            self._connection.listen(
                f"{self._topic}/compressed", lambda payload: self._receive(CompressedImage, payload)
            )
        if not self._connection.wait_for(self._is_fresh, timeout_s) or self._newest is None:
            raise ConnectError(
                f"no picture on {self._topic} within {timeout_s:g} s: is {self._connection.label} paused, or"
                " has its scenario no participant of kind endoscope that is connected to the gateway?"
            )
        model, payload, _ = self._newest
        message = decode(model, payload)
        pixels = _raw_pixels(message) if isinstance(message, Image) else _decompressed_pixels(message)
        stamp = message.header.stamp
        return Picture(pixels, message.header.frame_id, stamp.sec + 1e-9 * stamp.nanosec)

    def _is_fresh(self) -> bool:
        return self._newest is not None and monotonic() - self._newest[2] < _MAX_AGE_S

    def _receive(self, model: type[Image | CompressedImage], payload: bytes) -> None:
        self._newest = model, payload, monotonic()


def _raw_pixels(message: Image) -> NDArray[np.uint8]:
    if message.encoding != "rgb8":
        raise MessageError(f"a picture of encoding '{message.encoding}', expected rgb8")
    data = np.frombuffer(bytes(message.data), np.uint8)
    return data.reshape(message.height, message.width, 3)


def _decompressed_pixels(message: CompressedImage) -> NDArray[np.uint8]:
    try:
        from PIL import Image as Picture
    except ImportError as error:
        raise MissingExtraError("a compressed picture", "mujoco", "pillow") from error
    with Picture.open(BytesIO(bytes(message.data))) as picture:
        return np.asarray(picture.convert("RGB"))
