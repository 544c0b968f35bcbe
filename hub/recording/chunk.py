"""The messages of a chunk of an MCAP file, laid out by numpy.

The record types come from the `mcap` package. The package's `Writer` adds messages singly, at two to three
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
"""Number, time (ns) and bytes: a channel's message, or a block's vectors in their order."""


@dataclass(frozen=True)
class ChunkData:
    """The uncompressed records of a chunk, and the channel, time and offset of each message.

    The arrays have the shape (messages,).
    """

    records: bytes
    channels: NDArray[np.int64]
    times_ns: NDArray[np.int64]
    offsets: NDArray[np.int64]


def chunk_data(queued: Sequence[Queued], blocks: Sequence[VectorBlock] = ()) -> ChunkData:
    """Return the queued messages and vectors, at least one, in this order as the records of a chunk."""
    numbers, times, contents = zip(*queued, strict=True)
    times_ns = np.array(times, np.int64)
    kinds: NDArray[np.int64] = np.maximum(numbers, _ALONE)
    sizes = np.empty(len(queued), np.int64)
    pieces = [b""] * (2 * len(queued))  # not joined by twos: an image would be copied once more
    pieces[1::2] = contents
    parts: list[_Part] = []
    kind: int
    for kind in np.unique(kinds).tolist():
        places = np.flatnonzero(kinds == kind)
        at = places.tolist()
        if kind == _ALONE:
            made, sizes[places] = _message_headers([queued[place] for place in at])
            channels, offsets, first = np.array([numbers[place] for place in at])[:, None], _AT_START, 0
        else:
            block = blocks[kind - FIRST_BLOCK]
            made = block.records(times_ns[places], [contents[place] for place in at])
            channels, offsets, first, sizes[places] = block.channels, block.offsets, 1, block.size
        for place, one in zip(at, made, strict=True):
            pieces[2 * place + first] = one
        parts.append((places, channels, offsets))
    return _locate_messages(b"".join(pieces), sizes, times_ns, parts)


def _locate_messages(
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
    return ChunkData(records, *found[:, found[2].argsort()])


def _message_headers(queued: Sequence[Queued]) -> tuple[list[bytes], NDArray[np.int64]]:
    """Return the bytes in front of the payload of each single message, and the bytes of both."""
    channels, times, payloads = zip(*queued, strict=True)
    sizes = np.fromiter(map(len, payloads), np.int64, len(payloads)) + MESSAGE.itemsize
    headers = np.zeros(len(payloads), MESSAGE)
    headers["opcode"] = Opcode.MESSAGE
    headers["length"] = sizes - RECORD_HEADER_BYTES
    headers["channel"] = channels
    headers["log_time"] = headers["publish_time"] = times
    return headers.view(f"V{MESSAGE.itemsize}").tolist(), sizes
