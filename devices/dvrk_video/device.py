"""The kind `dvrk-video`: pictures of an endoscope go to sockets, as from the cameras of a real dVRK."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from time import time_ns
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from devices.dvrk_video.i420 import COLORIMETRY, to_i420
from devices.dvrk_video.messages import picture_caps, timestamps
from devices.dvrk_video.socket_sink import SocketSink
from hub.participant import Device, Params, Sample, Value, event_in
from schemas.errors import DeviceError, MessageError, MissingExtraError
from schemas.ports import Port
from schemas.ros import CompressedImage, Image

__all__ = ["DvrkVideo", "DvrkVideoParams"]

_EYES = ("left", "right")
_SERVE_NS = 50_000_000
"""Period at which readers are looked after while no picture comes."""

SocketName = Annotated[str, Field(pattern=r"^@dvrk:[A-Za-z0-9_]+:[A-Za-z0-9_]+$", max_length=100)]


class DvrkVideoParams(Params):
    """Sockets, and what is said of the pictures."""

    left: SocketName = Field(
        default="@dvrk:stereo_source:left", description="socket of the left eye's pictures"
    )
    right: SocketName = Field(
        default="@dvrk:stereo_source:right", description="socket of the right eye's pictures"
    )
    frame_rate: int = Field(
        default=25,
        ge=0,
        le=1000,
        description="pictures in a second, as readers are told; 0: not stated",
    )


class DvrkVideo(Device):
    """Shows the pictures of an endoscope to `unixfdsrc` of GStreamer, in I420, with their times."""

    params_model: ClassVar[type[Params]] = DvrkVideoParams
    params: DvrkVideoParams
    read_period_ns = _SERVE_NS

    def __init__(self, name: str, params: DvrkVideoParams) -> None:
        super().__init__(name, params)
        self._ports = tuple(
            event_in(f"{eye}/{picture}", model)
            for eye in _EYES
            for picture, model in (("image_raw", Image), ("image_raw/compressed", CompressedImage))
        )
        self._sinks: Mapping[str, SocketSink] = {}
        self._shown_ns: dict[str, int] = {}
        """Stamp of the picture shown last, by eye: a camera may publish each picture twice."""

    @property
    def ports(self) -> tuple[Port, ...]:
        """Pictures of both eyes, raw or compressed."""
        return self._ports

    def open(self, directory: Path) -> None:  # noqa: ARG002
        """Listen at both sockets. Raises DeviceError if another program does, or without Linux."""
        self.close()
        if sys.platform != "linux":
            raise DeviceError(f"device '{self.name}': sockets of the dVRK's video are of Linux")
        if find_spec("PIL") is None:
            raise MissingExtraError(f"device '{self.name}' (kind dvrk-video)", "dvrk-video", "pillow")
        self._shown_ns = {}
        left = SocketSink(self.params.left)
        try:
            self._sinks = {"left": left, "right": SocketSink(self.params.right)}
        except DeviceError:
            left.close()
            raise

    def read(self, t: int) -> list[Sample]:  # noqa: ARG002
        """Look after the readers; nothing enters the simulation."""
        for sink in self._sinks.values():
            sink.serve()
        return []

    def write(self, port: str, value: Value) -> None:
        """Show a picture to the readers of its socket. Raises MessageError for a damaged picture."""
        eye = port.partition("/")[0]
        sink = self._sinks.get(eye)
        if sink is None or not isinstance(value, Image | CompressedImage) or not sink.serve():
            return
        now_ns, stamp_ns = time_ns(), value.header.stamp.ns
        if self._shown_ns.get(eye) == stamp_ns:
            return
        self._shown_ns[eye] = stamp_ns
        try:
            pixels = _pixels(value)
        except (OSError, ValueError) as error:
            raise MessageError(f"device '{self.name}', '{port}': no picture: {error}") from error
        height, width = pixels.shape[:2]
        caps = picture_caps(width, height, self.params.frame_rate, COLORIMETRY)
        sink.send(to_i420(pixels), caps, timestamps({f"{eye}-source": now_ns}))

    def close(self) -> None:
        """Say goodbye to the readers."""
        for sink in self._sinks.values():
            sink.close()
        self._sinks = {}


def _pixels(picture: Image | CompressedImage) -> NDArray[np.uint8]:
    """Return a picture, shape (height, width, 3), RGB. Raises OSError or ValueError if damaged."""
    if isinstance(picture, Image):
        if picture.encoding != "rgb8":
            raise ValueError(f"encoding '{picture.encoding}', expected 'rgb8'")
        return picture.data.reshape(picture.height, picture.width, 3)
    from PIL import Image as Picture

    with Picture.open(BytesIO(picture.data.tobytes()), formats=("JPEG", "PNG")) as file:
        return np.asarray(file.convert("RGB"))
