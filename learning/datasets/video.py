"""A video file of a camera, written frame by frame."""

from __future__ import annotations

import os
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["AV1", "CODEC", "H264", "PIXEL_FORMAT", "Encoder", "Video"]

CODEC, PIXEL_FORMAT = "av1", "yuv420p"


@dataclass(frozen=True)
class Encoder:
    """An encoder of FFmpeg with its options."""

    name: str
    options: Mapping[str, str]
    threads: int = 0
    """Number of threads, on which the bytes of some encoders depend; 0: as the encoder chooses."""
    ticks: int = 0
    """Ticks of a second in which times of frames are stated; 0: all frames are a period apart."""


AV1 = Encoder("libsvtav1", {"crf": "30", "g": "2", "preset": "12", "svtav1-params": "lp=1"})
"""Options of LeRobot's own encoding: a sought frame is at most a frame after a key frame.

With one level of parallelism the bytes are the same, for 0.87 of the processor time.
"""
H264 = Encoder("libx264", {"crf": "20", "g": "30", "bf": "0", "mbtree": "0", "preset": "veryfast"}, 1, 90_000)
"""No frame waits for a later frame, so a frame is decoded when it is shown.

Without `mbtree=0` one file in twenty differs in its bytes (seen with PyAV 18).
"""


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

    def __init__(self, file: Path, size: tuple[int, int], fps: int, encoder: Encoder = AV1) -> None:
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
        self._stream: Any = self._container.add_stream(encoder.name, rate=fps, options=dict(encoder.options))
        if encoder.threads:
            self._stream.codec_context.thread_count = encoder.threads
        if encoder.ticks:
            self._frame_time = Fraction(1, encoder.ticks)
            self._stream.codec_context.time_base = self._frame_time
        self._stream.width, self._stream.height = size
        self._stream.pix_fmt = PIXEL_FORMAT
        with _kept_scheduling():
            self._stream.codec_context.open()

    def add(self, picture: NDArray[np.uint8], tick: int | None = None) -> None:
        """Append a picture, shape (height, width, 3), RGB, by default a period after the picture before.

        `tick`: time of the picture in the encoder's ticks, required by an encoder with ticks.
        """
        import av

        frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
        frame.pts, frame.time_base = self.frames if tick is None else tick, self._frame_time
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
