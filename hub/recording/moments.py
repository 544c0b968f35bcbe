"""The newest message of a topic before an instant, found by the indexes of the file.

Nothing else of the file is read. The chunk indexes of the summary state the channels of a chunk and the time
span of the messages; the message index behind a chunk, the places of a channel's messages
(https://mcap.dev/spec#message-index-op0x07).
"""

from __future__ import annotations

from collections import OrderedDict
from threading import Lock
from typing import NamedTuple

import numpy as np
from mcap.records import ChunkIndex
from numpy.typing import NDArray

from hub.recording.bag import Bag, BagMessage
from schemas.errors import RecordingError, did_you_mean

__all__ = ["Moments"]

_BYTES_KEPT = 64 * 2**20
"""Bytes of chunks kept uncompressed, 64 KiB or a picture each: neighbouring instants read the same chunks."""
_INDEXES_KEPT = 1024


class _Chunks(NamedTuple):
    """The chunks that may hold messages of a topic, by their first time."""

    indexes: list[ChunkIndex]
    starts_ns: NDArray[np.int64]
    """Shape (n,), ascending."""
    ends_ns: NDArray[np.int64]
    """Shape (n,): the latest end of all chunks up to this chunk."""


class Moments:
    """Looks messages up by time; may be used from several threads, also while the bag grows."""

    def __init__(self, bag: Bag) -> None:
        self._bag, self._grown = bag, bag.grown
        self._lock = Lock()
        self._chunks: dict[str, _Chunks] = {}
        self._records: OrderedDict[int, bytes] = OrderedDict()
        self._kept = 0
        """Bytes in `_records`."""
        self._times: OrderedDict[tuple[int, str], tuple[NDArray[np.int64], NDArray[np.int64]]] = OrderedDict()

    @property
    def span_ns(self) -> tuple[int, int]:
        """Times of the first and the last message; (0, 0) if there is none."""
        found = self._bag.chunks
        if not found:
            return 0, 0
        return min(one.message_start_time for one in found), max(one.message_end_time for one in found)

    def newest(self, topic: str, time_ns: int) -> BagMessage | None:
        """Return the message of `topic` with the greatest time up to `time_ns`; of equal times, the last.

        None if there is none by then. Raises RecordingError for a missing topic or damaged bytes.
        """
        if topic not in self._bag.topics:
            raise RecordingError(
                f"'{self._bag.file}' has no topic '{topic}'.{did_you_mean(topic, self._bag.topics)}"
            )
        with self._lock:
            chunks = self._chunks_of(topic)
            best: tuple[int, int, int] | None = None
            """Time, place of the chunk in the file, place of the message in the chunk."""
            found: ChunkIndex | None = None
            at = int(np.searchsorted(chunks.starts_ns, time_ns, side="right")) - 1
            while at >= 0 and (best is None or chunks.ends_ns[at] >= best[0]):
                index = chunks.indexes[at]
                times, offsets = self._sorted_index(index, topic)
                earlier = int(np.searchsorted(times, time_ns, side="right")) - 1
                if earlier >= 0:
                    place = int(times[earlier]), index.chunk_start_offset, int(offsets[earlier])
                    if best is None or place > best:
                        best, found = place, index
                at -= 1
            if best is None or found is None:
                return None
            payload = self._bag.payload(self._unpack_chunk(found), best[2])
            return BagMessage(topic, self._bag.topics[topic], best[0], payload)

    def _chunks_of(self, topic: str) -> _Chunks:
        if self._grown != self._bag.grown:
            self._grown, self._chunks = self._bag.grown, {}
        if topic not in self._chunks:
            indexes = sorted(
                self._bag.chunks_with(topic), key=lambda one: (one.message_start_time, one.chunk_start_offset)
            )
            ends = np.array([one.message_end_time for one in indexes], np.int64)
            self._chunks[topic] = _Chunks(
                indexes,
                np.array([one.message_start_time for one in indexes], np.int64),
                np.maximum.accumulate(ends) if len(ends) else ends,
            )
        return self._chunks[topic]

    def _sorted_index(self, chunk: ChunkIndex, topic: str) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return times (ns) and offsets of the messages of `topic` in a chunk, by time, then by place."""
        key = chunk.chunk_start_offset, topic
        if key not in self._times:
            times, offsets = self._bag.message_index(chunk, topic)
            order = np.lexsort((offsets, times))
            self._times[key] = times[order], offsets[order]
            if len(self._times) > _INDEXES_KEPT:
                self._times.popitem(last=False)
        self._times.move_to_end(key)
        return self._times[key]

    def _unpack_chunk(self, chunk: ChunkIndex) -> bytes:
        key = chunk.chunk_start_offset
        if key not in self._records:
            self._records[key] = self._bag.chunk(chunk)
            self._kept += len(self._records[key])
            while self._kept > _BYTES_KEPT and len(self._records) > 1:
                self._kept -= len(self._records.popitem(last=False)[1])
        self._records.move_to_end(key)
        return self._records[key]
