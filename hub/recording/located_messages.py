"""Messages in the records of a chunk of an MCAP file. Nothing in the file is trusted."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from typing import BinaryIO, NamedTuple

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Schema
from numpy.typing import NDArray

from hub.recording.unpacking import MAX_CHUNK_BYTES, unpack

__all__ = [
    "INDEX_ENTRY",
    "MAX_RECORD_BYTES",
    "MESSAGE_HEADER_BYTES",
    "RECORD_HEAD",
    "LocatedMessage",
    "chunk_declarations",
    "chunk_records",
    "index_entries",
    "located_messages",
    "message_at",
]

MAX_RECORD_BYTES = 64 * 2**20
"""A longer MCAP record is not read: chunks have 192 KiB and a step, or a single image."""

_MAX_RECORDS = 2**18
"""Records of a chunk: ours have some thousands; the smallest take 9 bytes, and each costs a reader 200."""

RECORD_HEAD = struct.Struct("<BQ")
"""Opcode and length of a record."""

_MESSAGE = struct.Struct("<BQHIQQ")
"""Opcode, length, channel, sequence, log time, publish time; the payload follows.

https://mcap.dev/spec#message-op0x05
"""

MESSAGE_HEADER_BYTES = _MESSAGE.size
"""Bytes of a message record before its payload."""

_MESSAGE_INDEX = struct.Struct("<BQHI")
"""Opcode, length, channel, bytes of the following entries (https://mcap.dev/spec#message-index-op0x07)."""

INDEX_ENTRY = np.dtype([("time", "<u8"), ("offset", "<u8")])


class LocatedMessage(NamedTuple):
    """The place of a message in the records of a chunk."""

    channel: int
    time_ns: int
    offset: int
    """Start of the record."""
    end: int


def index_entries(stream: BinaryIO, place: int, channel: int) -> NDArray[np.void]:
    """Return time and place in their chunk of the messages of `channel`, from the index at `place`."""
    stream.seek(place)
    opcode, length, stated, size = _MESSAGE_INDEX.unpack(stream.read(_MESSAGE_INDEX.size))
    if (opcode, stated, length) != (Opcode.MESSAGE_INDEX, channel, size + 6) or length > MAX_RECORD_BYTES:
        raise ValueError(f"there is no index of channel {channel} at {place}")
    return np.frombuffer(stream.read(size), INDEX_ENTRY)


def message_at(records: bytes, offset: int, channels: set[int]) -> LocatedMessage:
    """Return the message that begins at a place; raises ValueError or struct.error if none does."""
    opcode, length, channel, _, time_ns, _ = _MESSAGE.unpack_from(records, offset)
    end = offset + RECORD_HEAD.size + length
    if opcode != Opcode.MESSAGE or channel not in channels or end > len(records):
        raise ValueError(f"the index of a chunk is wrong: no message at {offset}")
    return LocatedMessage(channel, time_ns, offset, end)


def chunk_records(chunk: Chunk) -> bytes:
    """Return the uncompressed records of `chunk`, checked against its size and checksum.

    Raises ValueError if size or checksum differ or the chunk is too large, and the decompressors' errors.
    """
    size = chunk.uncompressed_size
    if size > MAX_CHUNK_BYTES:
        raise ValueError(f"a chunk states {size} bytes; at most {MAX_CHUNK_BYTES} are unpacked")
    records = unpack(chunk.compression, chunk.data, size)
    if len(records) != size:
        raise ValueError(f"a chunk has {len(records)} bytes instead of {size}")
    if chunk.uncompressed_crc and zlib.crc32(records) != chunk.uncompressed_crc:
        raise ValueError("a chunk has another checksum than the stated one")
    return records


def located_messages(records: bytes) -> Iterator[LocatedMessage]:
    """Find the messages in the records of a chunk.

    Raises ValueError or struct.error if records do not end at their stated length, or if there are too many.
    """
    for opcode, at, end in _record_heads(records):
        if opcode == Opcode.MESSAGE:
            _, _, channel, _, time_ns, _ = _MESSAGE.unpack_from(records, at)
            yield LocatedMessage(channel, time_ns, at, end)


def chunk_declarations(records: bytes) -> Iterator[Schema | Channel]:
    """Yield the schemas and channels in the records of a chunk; raises the errors of `located_messages`."""
    for opcode, at, end in _record_heads(records):
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            stream = ReadDataStream(BytesIO(records[at + RECORD_HEAD.size : end]))
            yield Schema.read(stream) if opcode == Opcode.SCHEMA else Channel.read(stream)


def _record_heads(records: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield opcode, start and end of each record of a chunk."""
    at = count = 0
    while at < len(records):
        opcode, length = RECORD_HEAD.unpack_from(records, at)
        end, count = at + RECORD_HEAD.size + length, count + 1
        if end > len(records):
            raise ValueError(f"a record of {length} bytes at {at} passes the end of its chunk")
        if count > _MAX_RECORDS:
            raise ValueError(f"a chunk has more than {_MAX_RECORDS} records")
        yield opcode, at, end
        at = end
