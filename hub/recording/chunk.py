"""The messages of one chunk of an MCAP file, laid out by numpy.

The record types are those of the `mcap` package. Its `Writer` takes messages one by one, at two to three
times the cost (docs/decisions/0005-recorder.md), and a recorder shares the interpreter with the step loop.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from hub.recording.vector_block import MESSAGE, RECORD_HEADER_BYTES, VectorBlock

__all__ = ["FIRST_BLOCK", "ChunkData", "Queued", "chunk_data"]

FIRST_BLOCK = 2**16
"""Blocks have numbers from here on; a channel's has 16 bits."""

_ALONE = FIRST_BLOCK - 1
"""Stands for all channels: their messages are laid out together."""
_AT_START = np.zeros(1, np.int64)

_Part = tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]
"""Entries of a queue with equally many messages each.

Their places in the queue, shape (entries,); the channels of their messages, shape (messages,) or (entries,
messages); where messages begin in an entry's records, shape (messages,).
"""

Queued = tuple[int, int, bytes]
"""Number, time (ns) and bytes: of a channel a message, of a block its vectors one after the other."""


@dataclass(frozen=True)
class ChunkData:
    """The records of one chunk, uncompressed, and the channel, time and offset of each message.

    The arrays have the shape (messages,).
    """

    records: bytes
    channels: NDArray[np.int64]
    times_ns: NDArray[np.int64]
    offsets: NDArray[np.int64]


def chunk_data(queued: Sequence[Queued], blocks: Sequence[VectorBlock] = ()) -> ChunkData:
    """Return what was queued, in this order, as the records of one chunk."""
    numbers, times, contents = zip(*queued, strict=True)
    of_number: dict[int, list[int]] = {}
    for place, number in enumerate(numbers):
        of_number.setdefault(max(number, _ALONE), []).append(place)
    times_ns = np.array(times, np.int64)
    heads, records = [b""] * len(queued), list[bytes](contents)
    parts: list[_Part] = []
    for number, places in of_number.items():
        if number == _ALONE:
            filled, made = heads, _headers([queued[place] for place in places])
            channels, offsets = np.array([numbers[place] for place in places])[:, None], _AT_START
        else:
            block = blocks[number - FIRST_BLOCK]
            filled, made = records, block.records(times_ns[places], [contents[place] for place in places])
            channels, offsets = block.channels, block.offsets
        for place, one in zip(places, made, strict=True):
            filled[place] = one
        parts.append((np.array(places), channels, offsets))
    pieces = [b""] * (2 * len(queued))  # not joined by twos: an image would be copied once more
    pieces[0::2], pieces[1::2] = heads, records
    sizes = np.fromiter(map(len, pieces), np.int64, len(pieces)).reshape(-1, 2).sum(axis=1)
    return _located(b"".join(pieces), sizes, times_ns, parts)


def _located(
    records: bytes, sizes: NDArray[np.int64], times_ns: NDArray[np.int64], parts: Sequence[_Part]
) -> ChunkData:
    """Return the chunk of `records`, of entries with their sizes, shape (entries,), and times, the same."""
    starts = np.cumsum(sizes) - sizes
    found = np.empty((3, sum(len(places) * len(offsets) for places, _, offsets in parts)), np.int64)
    at = 0
    for places, channels, offsets in parts:
        end = at + len(places) * len(offsets)
        part = found[:, at:end].reshape(3, len(places), len(offsets))
        part[0], part[1], part[2] = channels, times_ns[places, None], starts[places, None] + offsets
        at = end
    channels, times, offsets = found[:, found[2].argsort()]
    return ChunkData(records, channels, times, offsets)


def _headers(queued: Sequence[Queued]) -> list[bytes]:
    """Return what is in front of the payload of each message, which stands alone."""
    channels, times, payloads = zip(*queued, strict=True)
    headers = np.zeros(len(payloads), MESSAGE)
    headers["opcode"] = Opcode.MESSAGE
    headers["length"] = [len(payload) + (MESSAGE.itemsize - RECORD_HEADER_BYTES) for payload in payloads]
    headers["channel"] = channels
    headers["log_time"] = headers["publish_time"] = times
    return headers.view(f"V{MESSAGE.itemsize}").tolist()
