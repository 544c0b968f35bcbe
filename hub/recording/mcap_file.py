"""Writes MCAP files of ROS 2 messages, a whole chunk at a time, and the rosbag2 metadata beside the file.

The record types come from the `mcap` package; the many index entries of a chunk are made together. Format:
https://mcap.dev/spec; rosbag2 metadata version 9, as ROS 2 Jazzy writes.
"""

from __future__ import annotations

import errno
import struct
import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, BinaryIO

import lz4.frame
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC
from ruamel.yaml import YAML

from hub.recording.chunk import ChunkData
from hub.recording.message_index import chunk_index, message_index
from hub.recording.vector_block import RECORD_HEADER_BYTES
from schemas.errors import RecordingError

__all__ = ["McapFile", "create_bag", "write_rosbag2_metadata"]

_CHUNK = struct.Struct("<BQQQQII3sQ")
"""The bytes in front of a chunk's compressed records (https://mcap.dev/spec#chunk-op0x06)."""
_COPIED_BYTES = 2**20
"""Bytes of the chunks' indexes copied at once, when a file is finished."""
_INDEX_BYTES = 2**16
"""Bytes of the chunks' indexes in memory: for each call of the system the recorder waits for the interpreter.
"""


class McapFile:
    """An MCAP file being written.

    Every append is whole or not at all, so the file can be recovered whenever writing stops.
    """

    def __init__(self, path: Path) -> None:
        """Create the file. Raises OSError if the file exists or cannot be written."""
        self.path = path
        self.schemas: list[Schema] = []
        self.channels: list[Channel] = []
        self.size = 0
        self._attachments: list[AttachmentIndex] = []
        self._chunks, self._start_ns, self._end_ns = 0, 0, 0
        self._counts: dict[int, int] = {}
        self._file = path.open("xb", buffering=0)
        # An hour has tens of thousands of chunks: their indexes wait for the summary on disk, not in memory.
        self._index: BinaryIO = TemporaryFile(dir=path.parent, buffering=0)  # noqa: SIM115 - closed in `close`
        self._index_size = 0
        self._indexes_in_memory: list[bytes] = []
        """Indexes not yet in the file of indexes."""
        self._append_bytes(MCAP0_MAGIC + _bytes_of(Header("ros2", "trocar")))

    def attach(self, name: str, data: bytes) -> None:
        """Add an attachment."""
        media_type = f"application/{Path(name).suffix[1:] or 'octet-stream'}"
        record = _bytes_of(Attachment(create_time=0, log_time=0, name=name, media_type=media_type, data=data))
        index = AttachmentIndex(self._append_bytes(record), len(record), 0, 0, len(data), name, media_type)
        self._attachments.append(index)

    def declare(self, schema: Schema, channel: Channel) -> None:
        """Add a channel and, if new, the schema, before the first of the messages."""
        new = schema not in self.schemas
        self._append_bytes(_bytes_of(schema, channel) if new else _bytes_of(channel))
        self.schemas += [schema] if new else []
        self.channels.append(channel)

    def add_chunk(self, data: ChunkData) -> None:
        """Compress and append a chunk with message indexes. Raises OSError with nothing appended."""
        compressed = lz4.frame.compress(data.records)
        start, end = int(data.times_ns.min()), int(data.times_ns.max())
        size, checksum = len(data.records), zlib.crc32(data.records)
        length = _CHUNK.size - RECORD_HEADER_BYTES + len(compressed)
        head = _CHUNK.pack(Opcode.CHUNK, length, start, end, size, checksum, 3, b"lz4", len(compressed))
        index = message_index(data)
        record = chunk_index(data, index, self.size, len(head) + len(compressed), len(compressed))
        if sum(map(len, self._indexes_in_memory)) > _INDEX_BYTES:
            self._put_indexes_aside()
        self._append_bytes(b"".join((head, compressed, index.records)))
        self._indexes_in_memory.append(record)
        self._start_ns = min(self._start_ns, start) if self._chunks else start
        self._end_ns = max(self._end_ns, end)
        self._chunks += 1
        for channel, count in zip(index.channels.tolist(), index.counts.tolist(), strict=True):
            self._counts[channel] = self._counts.get(channel, 0) + count

    def _put_indexes_aside(self) -> None:
        records = b"".join(self._indexes_in_memory)
        self._index.seek(self._index_size)
        _write(self._index, records)
        self._index_size += len(records)
        self._indexes_in_memory.clear()

    @property
    def statistics(self) -> Statistics:
        """Counts and times of the file's messages."""
        return Statistics(
            len(self._attachments),
            len(self.channels),
            self._counts,
            self._chunks,
            sum(self._counts.values()),
            self._end_ns,
            self._start_ns,
            0,
            len(self.schemas),
        )

    def finish(self) -> None:
        """Append summary and footer. Raises OSError with nothing appended."""
        size = self.size
        try:
            self._append_bytes(_bytes_of(DataEnd(0)))
            self._append_summary()
        except OSError:
            self._cut_tail(size)
            raise

    def _append_summary(self) -> None:
        summary_start, checksum = self.size, 0
        places: list[SummaryOffset] = []
        for opcode, parts in self._summary_parts():
            start = self.size
            for part in parts:
                self._append_bytes(part)
                checksum = zlib.crc32(part, checksum)
            if self.size > start:
                places.append(SummaryOffset(opcode, start, self.size - start))
        offset_start, offsets = self.size, _bytes_of(*places)
        footer_start = struct.pack("<BQQQ", Opcode.FOOTER, 20, summary_start, offset_start)
        checksum = zlib.crc32(footer_start, zlib.crc32(offsets, checksum))
        footer = _bytes_of(Footer(summary_start, offset_start, checksum))
        self._append_bytes(offsets + footer + MCAP0_MAGIC)

    def _summary_parts(self) -> Iterator[tuple[Opcode, Iterable[bytes]]]:
        yield Opcode.SCHEMA, [_bytes_of(*self.schemas)]
        yield Opcode.CHANNEL, [_bytes_of(*self.channels)]
        yield Opcode.STATISTICS, [_bytes_of(self.statistics)]
        yield Opcode.CHUNK_INDEX, self._chunk_indexes()
        yield Opcode.ATTACHMENT_INDEX, [_bytes_of(*self._attachments)]

    def _chunk_indexes(self) -> Iterator[bytes]:
        self._index.seek(0)
        left = self._index_size
        while left:
            part = self._index.read(min(left, _COPIED_BYTES))
            if not part:
                raise OSError(errno.EIO, "the index of the chunks cannot be read back")
            left -= len(part)
            yield part
        yield from self._indexes_in_memory

    def close(self) -> None:
        """Close the file, finished or not."""
        self._file.close()
        self._index.close()

    def _append_bytes(self, data: bytes) -> int:
        """Write `data` at the end and return the offset."""
        try:
            _write(self._file, data)
        except OSError:
            self._cut_tail(self.size)
            raise
        offset, self.size = self.size, self.size + len(data)
        return offset

    def _cut_tail(self, size: int) -> None:
        """Remove everything after `size` bytes."""
        self._file.truncate(size)
        self._file.seek(size)
        self.size = size


def _write(file: BinaryIO, data: bytes) -> None:
    """Write all of `data`; a single call of an unbuffered file may write less."""
    rest = memoryview(data)
    while rest:
        rest = rest[file.write(rest) :]


def _bytes_of(*records: McapRecord) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return builder.end()


def create_bag(directory: Path) -> McapFile:
    """Create `directory` and, inside, the file of a one-file bag.

    Raises RecordingError if the directory holds something or cannot be written.
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
        if any(directory.iterdir()):
            raise RecordingError(
                f"'{directory}' is not empty, and a recording overwrites nothing: name a new directory, or"
                " remove this one"
            )
        return McapFile(directory / f"{directory.resolve().name}_0.mcap")
    except OSError as error:
        raise RecordingError(
            f"cannot record to '{directory}': {error.strerror}; name a directory that can be written"
        ) from error


def write_rosbag2_metadata(file: McapFile) -> None:
    """Write `metadata.yaml` beside `file`: the directory becomes a rosbag2 bag."""
    statistics = file.statistics
    types = {schema.id: schema.name for schema in file.schemas}
    when: dict[str, Any] = {
        "duration": {"nanoseconds": statistics.message_end_time - statistics.message_start_time},
        "starting_time": {"nanoseconds_since_epoch": statistics.message_start_time},
        "message_count": statistics.message_count,
    }
    topics: list[dict[str, Any]] = [
        {
            "topic_metadata": {
                "name": channel.topic,
                "type": types[channel.schema_id],
                "serialization_format": channel.message_encoding,
                "offered_qos_profiles": [],
                "type_description_hash": channel.metadata.get("topic_type_hash", ""),
            },
            "message_count": statistics.channel_message_counts.get(channel.id, 0),
        }
        for channel in file.channels
    ]
    information: dict[str, Any] = {
        "version": 9,
        "storage_identifier": "mcap",
        "relative_file_paths": [file.path.name],
        **when,
        "topics_with_message_count": topics,
        "compression_format": "",
        "compression_mode": "",
        "files": [{"path": file.path.name, **when}],
        "custom_data": None,
        "ros_distro": "jazzy",
    }
    yaml: Any = YAML(typ="safe")
    yaml.default_flow_style = False
    with (file.path.parent / "metadata.yaml").open("w", encoding="utf-8") as stream:
        yaml.dump({"rosbag2_bagfile_information": information}, stream)
