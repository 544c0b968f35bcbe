"""A video file of a camera, written frame by frame."""

from __future__ import annotations

import os
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["CODEC", "PIXEL_FORMAT", "Video"]

CODEC, PIXEL_FORMAT = "av1", "yuv420p"
_ENCODER = "libsvtav1"
_OPTIONS = {"crf": "30", "g": "2", "preset": "12"}
"""Options of LeRobot's own encoding: a sought frame is at most a frame after a key frame."""


@contextmanager
def _kept_scheduling() -> Generator[None]:
    """Keep the scheduling policy of this thread.

    As root, SVT-AV1 (seen with PyAV 18) raises the caller to SCHED_FIFO with priority 99, above
    everything on the machine, and so every process started afterwards.
    """
    if not hasattr(os, "sched_getscheduler"):
        yield
        return
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        yield
    finally:
        os.sched_setscheduler(0, *before)


class Video:
    """An MP4 file in the making."""

    def __init__(self, file: Path, size: tuple[int, int], fps: int) -> None:
        """Create the file; `size` is width and height, pixels."""
        os.environ.setdefault("SVT_LOG", "1")  # errors alone: the encoder writes its settings to stderr
        import av

        file.parent.mkdir(parents=True, exist_ok=True)
        self.frames = 0
        """Number of frames added."""
        self.size_bytes = 0
        """Size of the encoded part, bytes."""
        self._frame_time = Fraction(1, fps)
        self._container = av.open(str(file), "w")
        self._stream: Any = self._container.add_stream(_ENCODER, rate=fps, options=_OPTIONS)
        self._stream.width, self._stream.height = size
        self._stream.pix_fmt = PIXEL_FORMAT
        with _kept_scheduling():
            self._stream.codec_context.open()

    def add(self, picture: NDArray[np.uint8]) -> None:
        """Append a picture, shape (height, width, 3), RGB."""
        import av

        frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
        frame.pts, frame.time_base = self.frames, self._frame_time
        self._write(self._stream.encode(frame))
        self.frames += 1

    def close(self) -> None:
        """Finish the file. May be called twice."""
        if self._stream is not None:
            self._write(self._stream.encode())
            self._container.close()
            self._stream = None

    def _write(self, packets: Sequence[Any]) -> None:
        self.size_bytes += sum(packet.size for packet in packets)
        self._container.mux(packets)
