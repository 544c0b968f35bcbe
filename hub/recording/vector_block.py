"""Vectors recorded together: the bytes of many steps become message records at once.

A message of a vector has a fixed length and layout, so only times and numbers differ from step to step. The
source of each byte of the records is worked out once; then a single call of numpy, without the interpreter's
lock, makes the records of many steps.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from schemas.vectors import VectorCodec

__all__ = ["MESSAGE", "RECORD_HEADER_BYTES", "VectorBlock"]

MESSAGE = np.dtype(
    [
        ("opcode", "<u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log_time", "<u8"),
        ("publish_time", "<u8"),
    ]
)
"""Header in front of a message's payload (https://mcap.dev/spec)."""
RECORD_HEADER_BYTES = 9
"""Opcode and length, not counted by the length."""

_TIME = np.dtype([("ns", "<u8"), ("sec", "<i4"), ("nanosec", "<u4")])
"""A time in MCAP, and a stamp in CDR."""


class VectorBlock:
    """The records of vectors valid at the same time, in their order.

    Args:
        vectors: Channel and codec of each.
    """

    def __init__(self, vectors: Sequence[tuple[int, VectorCodec]]) -> None:
        self.channels = np.array([channel for channel, _ in vectors])
        """Channel of each message, shape (vectors,)."""
        sizes = np.array([MESSAGE.itemsize + len(codec.template) for _, codec in vectors])
        ends = np.cumsum(sizes)
        self.offsets: NDArray[np.int64] = ends - sizes
        """Offset of each message in the records of a step, shape (vectors,)."""
        self.size = int(ends[-1])
        """Bytes of the records of a step."""
        self._template = b"".join(_header(channel, codec) + codec.template for channel, codec in vectors)
        self._vectors = slice(self.size, self.size + sum(8 * codec.size for _, codec in vectors))
        self._sources = self._places(vectors)
        """For each byte of the records, the place in the concatenated template, vectors and time."""
        self._rows = self._new_rows(0)
        """Template, vectors and time of each step, shape (steps, bytes); the template stays."""

    def _places(self, vectors: Sequence[tuple[int, VectorCodec]]) -> NDArray[np.intp]:
        places = np.arange(self.size)
        number, time = self._vectors.start, self._vectors.stop
        stamp, end = time + 8, time + _TIME.itemsize
        for start, (_, codec) in zip(self.offsets.tolist(), vectors, strict=True):
            payload = start + MESSAGE.itemsize
            for at in (payload - 16, payload - 8):
                places[at : at + 8] = range(time, stamp)
            if codec.stamp is not None:
                at = payload + codec.stamp.start
                places[at : at + 8] = range(stamp, end)
            for begin, finish, part in codec.spans:
                places[payload + begin : payload + finish] = range(number + part.start, number + part.stop)
            number += 8 * codec.size
        return places

    def _new_rows(self, steps: int) -> NDArray[np.uint8]:
        rows = np.empty((steps, self._vectors.stop + _TIME.itemsize), np.uint8)
        rows[:, : self.size] = np.frombuffer(self._template, np.uint8)
        return rows

    def records(self, times_ns: NDArray[np.int64], vectors: Sequence[bytes]) -> list[bytes]:
        """Return the records of each step, from the time and the bytes of the vectors in their order."""
        steps = len(vectors)
        if len(self._rows) < steps:
            self._rows = self._new_rows(steps)
        rows = self._rows[:steps]
        times = np.empty(steps, _TIME)
        times["ns"] = times_ns
        times["sec"], times["nanosec"] = np.divmod(times_ns, 10**9)
        rows[:, self._vectors] = np.frombuffer(b"".join(vectors), np.uint8).reshape(steps, -1)
        rows[:, self._vectors.stop :] = times.view(np.uint8).reshape(steps, -1)
        return rows.take(self._sources, axis=1).view(f"V{self.size}").ravel().tolist()


def _header(channel: int, codec: VectorCodec) -> bytes:
    header = np.zeros(1, MESSAGE)
    header["opcode"], header["channel"] = Opcode.MESSAGE, channel
    header["length"] = MESSAGE.itemsize - RECORD_HEADER_BYTES + len(codec.template)
    return header.tobytes()
