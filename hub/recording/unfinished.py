"""The summary of a recording without a summary: still being written, or cut short."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, AttachmentIndex, Channel, ChunkIndex, Schema, Statistics
from mcap.summary import Summary
from mcap.writer import MCAP0_MAGIC

__all__ = ["Unfinished"]

_RECORD = struct.Struct("<BQ")
"""Opcode and length of a record."""
_CHUNK = struct.Struct("<QQQI")
"""Start, end, uncompressed bytes, checksum (https://mcap.dev/spec#chunk-op0x06)."""
_INDEX = struct.Struct("<HI")
"""Channel, and bytes of the entries (https://mcap.dev/spec#message-index-op0x07)."""
_ENTRY_BYTES = 16


class _Place(NamedTuple):
    """Where a record is in the file."""

    opcode: int
    start: int
    end: int


class Unfinished:
    """Makes the summary of a file from the heads of the records, and adds records written later.

    An incomplete record is left for the next look. The index of the last chunk may be half written: the index
    is left out, and readers read the chunk itself.
    """

    def __init__(self, file: Path) -> None:
        self._file = file
        self._next = len(MCAP0_MAGIC)
        self._chunks: list[ChunkIndex] = []
        """All but the last."""
        self._counts: dict[int, int] = {}
        self.summary = Summary()

    def grow(self) -> bool:
        """Add the records written since the last look, and return whether there were any.

        Raises the parser's errors at damaged bytes.
        """
        before, last = len(self.summary.chunk_indexes), None
        with self._file.open("rb") as stream:
            for place in _whole_records(stream, self._next):
                if place.opcode == Opcode.MESSAGE_INDEX and last is not None:
                    _add_message_index(stream, place, last)
                    continue
                self._settle(stream, last)
                last, self._next = None, place.start
                if place.opcode == Opcode.CHUNK:
                    last = _read_chunk_index(stream, place)
                else:
                    self._add(stream, place)
                    self._next = place.end
        if last is not None:
            last.message_index_offsets.clear()
        chunks = self._chunks if last is None else [*self._chunks, last]
        self.summary.chunk_indexes = chunks
        self.summary.statistics = _count_statistics(chunks, self._counts)
        return len(chunks) > before

    def _settle(self, stream: BinaryIO, chunk: ChunkIndex | None) -> None:
        """Accept a chunk after the beginning of another record: the index is whole."""
        if chunk is None:
            return
        self._chunks = [*self._chunks, chunk]
        for channel, start in chunk.message_index_offsets.items():
            stream.seek(start + _RECORD.size)
            _, size = _INDEX.unpack(stream.read(_INDEX.size))
            self._counts[channel] = self._counts.get(channel, 0) + size // _ENTRY_BYTES

    def _add(self, stream: BinaryIO, place: _Place) -> None:
        stream.seek(place.start + _RECORD.size)
        if place.opcode == Opcode.SCHEMA:
            schema = Schema.read(ReadDataStream(stream))
            self.summary.schemas[schema.id] = schema
        elif place.opcode == Opcode.CHANNEL:
            channel = Channel.read(ReadDataStream(stream))
            self.summary.channels[channel.id] = channel
        elif place.opcode == Opcode.ATTACHMENT:
            one = Attachment.read(ReadDataStream(stream))
            size = place.end - place.start
            self.summary.attachment_indexes.append(
                AttachmentIndex(
                    place.start, size, one.log_time, one.create_time, len(one.data), one.name, one.media_type
                )
            )


def _whole_records(stream: BinaryIO, at: int) -> Iterator[_Place]:
    """Yield the records from a place on, up to the first incomplete record or the file's end section."""
    size = stream.seek(0, 2)
    while at + _RECORD.size <= size:
        stream.seek(at)
        opcode, length = _RECORD.unpack(stream.read(_RECORD.size))
        end = at + _RECORD.size + length
        if end > size or opcode in (0, Opcode.DATA_END):  # 0: a disk that lost its power leaves zeros
            return
        yield _Place(opcode, at, end)
        at = end


def _read_chunk_index(stream: BinaryIO, place: _Place) -> ChunkIndex:
    """Return the index of a chunk, without channels."""
    stream.seek(place.start + _RECORD.size)
    start_ns, end_ns, size, _ = _CHUNK.unpack(stream.read(_CHUNK.size))
    reader = ReadDataStream(stream)
    compression, compressed = reader.read_prefixed_string(), reader.read8()
    return ChunkIndex(
        chunk_length=place.end - place.start,
        chunk_start_offset=place.start,
        compression=compression,
        compressed_size=compressed,
        message_end_time=end_ns,
        message_index_length=0,
        message_index_offsets={},
        message_start_time=start_ns,
        uncompressed_size=size,
    )


def _add_message_index(stream: BinaryIO, place: _Place, chunk: ChunkIndex) -> None:
    stream.seek(place.start + _RECORD.size)
    channel, _ = _INDEX.unpack(stream.read(_INDEX.size))
    chunk.message_index_offsets[channel] = place.start


def _count_statistics(chunks: list[ChunkIndex], counts: dict[int, int]) -> Statistics:
    """Return times and counts; a last chunk without index is not counted."""
    return Statistics(
        attachment_count=0,
        channel_count=0,
        channel_message_counts=dict(counts),
        chunk_count=len(chunks),
        message_count=sum(counts.values()),
        message_end_time=max((one.message_end_time for one in chunks), default=0),
        message_start_time=min((one.message_start_time for one in chunks), default=0),
        metadata_count=0,
        schema_count=0,
    )
