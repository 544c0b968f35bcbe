"""The messages of one chunk of an MCAP file, laid out by numpy.

The record types are those of the `mcap` package. Its `Writer` takes messages one by one, at two to three
times the cost (docs/decisions/0005-recorder.md), and a recorder shares the interpreter with the step loop.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from hub.recording.vector_block import MESSAGE, RECORD_HEADER_BYTES, VectorBlock

__all__ = ["FIRST_BLOCK", "ChunkData", "Queued", "chunk_data"]

FIRST_BLOCK = 2**16
"""Blocks have numbers from here on; a channel's has 16 bits."""

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
    alone: list[int] = []
    in_blocks: dict[int, list[int]] = {}
    for place, (number, _, _) in enumerate(queued):
        (alone if number < FIRST_BLOCK else in_blocks.setdefault(number, [])).append(place)
    records = [b""] * len(queued)
    times_ns = np.empty(len(queued), np.int64)
    parts: list[_Part] = []
    if alone:
        part = [queued[place] for place in alone]
        _fill(records, alone, _messages(part))
        times_ns[alone] = [time_ns for _, time_ns, _ in part]
        channels = np.array([channel for channel, _, _ in part])
        parts.append(_Part(np.array(alone), channels[:, None], np.zeros(1, np.int64)))
    for number, places in in_blocks.items():
        block, part = blocks[number - FIRST_BLOCK], [queued[place] for place in places]
        times_ns[places] = times = np.array([time_ns for _, time_ns, _ in part])
        _fill(records, places, block.records(times, [vectors for _, _, vectors in part]))
        channels = np.broadcast_to(block.channels, (len(places), len(block.channels)))
        parts.append(_Part(np.array(places), channels, block.offsets))
    sizes = np.fromiter(map(len, records), np.int64, len(records))
    starts = np.cumsum(sizes) - sizes
    offsets = np.concatenate([(starts[part.places, None] + part.offsets).ravel() for part in parts])
    order = np.argsort(offsets)
    places = np.concatenate([np.repeat(part.places, len(part.offsets)) for part in parts])
    channels = np.concatenate([part.channels.ravel() for part in parts])
    return ChunkData(b"".join(records), channels[order], times_ns[places[order]], offsets[order])


class _Part(NamedTuple):
    """Entries of the queue with equally many messages each."""

    places: NDArray[np.int64]
    """Of the entries in the queue, shape (entries,)."""
    channels: NDArray[np.int64]
    """Of the messages, shape (entries, messages)."""
    offsets: NDArray[np.int64]
    """Of the messages in the records of an entry, shape (messages,)."""


def _fill(records: list[bytes], places: Sequence[int], made: Sequence[bytes]) -> None:
    for place, record in zip(places, made, strict=True):
        records[place] = record


def _messages(queued: Sequence[Queued]) -> list[bytes]:
    """Return the record of each message, which stands alone."""
    channels, times, payloads = zip(*queued, strict=True)
    headers = np.zeros(len(payloads), MESSAGE)
    headers["opcode"] = Opcode.MESSAGE
    headers["length"] = [len(payload) + (MESSAGE.itemsize - RECORD_HEADER_BYTES) for payload in payloads]
    headers["channel"] = channels
    headers["log_time"] = headers["publish_time"] = times
    given = zip(headers.view(f"V{MESSAGE.itemsize}").tolist(), payloads, strict=True)
    return [header + payload for header, payload in given]
