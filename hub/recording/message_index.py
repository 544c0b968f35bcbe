"""Where the messages of each channel are in a chunk, as records of an MCAP file.

A session has up to two hundred channels, each with an index in every chunk: all are made together. Format:
https://mcap.dev/spec#message-index-op0x07, https://mcap.dev/spec#chunk-index-op0x08.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from hub.recording.chunk import ChunkData
from hub.recording.vector_block import RECORD_HEADER_BYTES

__all__ = ["MessageIndex", "chunk_index", "message_index"]

_ENTRY = np.dtype([("time", "<u8"), ("offset", "<u8")])
_HEAD = np.dtype([("opcode", "<u1"), ("length", "<u8"), ("channel", "<u2"), ("bytes", "<u4")])
_PLACE = np.dtype([("channel", "<u2"), ("offset", "<u8")])
_CHUNK_HEAD = struct.Struct("<BQQQQQI")
_CHUNK_TAIL = struct.Struct("<QI3sQQ")


class MessageIndex(NamedTuple):
    """The message index records of a chunk; the arrays have the shape (channels,)."""

    records: bytes
    channels: NDArray[np.int64]
    counts: NDArray[np.int64]
    """How many messages each channel has."""
    offsets: NDArray[np.int64]
    """Offset of each channel's record in `records`."""


def message_index(data: ChunkData) -> MessageIndex:
    """Return the message index records of a chunk, a record for each channel."""
    order = np.argsort(data.channels, kind="stable")
    entries = np.empty(len(order), _ENTRY)
    entries["time"], entries["offset"] = data.times_ns[order], data.offsets[order]
    counts = np.bincount(data.channels)
    channels = np.flatnonzero(counts)
    counts = counts[channels]
    heads = np.empty(len(channels), _HEAD)
    heads["opcode"], heads["channel"] = Opcode.MESSAGE_INDEX, channels
    heads["bytes"] = sizes = counts * _ENTRY.itemsize
    heads["length"] = sizes + (_HEAD.itemsize - RECORD_HEADER_BYTES)
    ends = np.cumsum(sizes)
    all_entries = entries.tobytes()
    parts = [b""] * (2 * len(channels))
    parts[0::2] = heads.view(f"V{_HEAD.itemsize}").tolist()
    starts = (ends - sizes).tolist()
    parts[1::2] = [all_entries[start:end] for start, end in zip(starts, ends.tolist(), strict=True)]
    offsets = ends - sizes + _HEAD.itemsize * np.arange(len(channels))
    return MessageIndex(b"".join(parts), channels, counts, offsets)


def chunk_index(
    data: ChunkData, index: MessageIndex, at: int, chunk_bytes: int, compressed_bytes: int
) -> bytes:
    """Return the chunk index record of a chunk, compressed with lz4, in the file at `at`.

    `chunk_bytes` is the length of the chunk's record; `index` follows after the record.
    """
    places = np.empty(len(index.channels), _PLACE)
    places["channel"], places["offset"] = index.channels, index.offsets + (at + chunk_bytes)
    tail = _CHUNK_TAIL.pack(len(index.records), 3, b"lz4", compressed_bytes, len(data.records))
    head = _CHUNK_HEAD.pack(
        Opcode.CHUNK_INDEX,
        _CHUNK_HEAD.size - RECORD_HEADER_BYTES + places.nbytes + len(tail),
        int(data.times_ns.min()),
        int(data.times_ns.max()),
        at,
        chunk_bytes,
        places.nbytes,
    )
    return head + places.tobytes() + tail
