"""Reads MCAP recordings of ROS 2 messages, of Trocar and ROS tools. Nothing in the files is trusted."""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Collection, Generator, Iterator
from contextlib import contextmanager
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Attachment, Channel, Chunk, ChunkIndex, Schema
from mcap.stream_reader import StreamReader
from mcap.summary import Summary
from mcap.writer import MCAP0_MAGIC
from numpy.typing import NDArray

from hub.recording.unfinished import Unfinished
from hub.recording.unpacking import MAX_CHUNK_BYTES, most_unpacked, unpack
from schemas import ros
from schemas.codec import decode, message_type
from schemas.errors import CutShortError, MessageError, RecordingError, did_you_mean
from schemas.ports import Port
from schemas.vectors import has_vector

__all__ = [
    "MAX_RECORD_BYTES",
    "MESSAGE_HEADER_BYTES",
    "Bag",
    "BagMessage",
    "bag_file",
    "chunk_declarations",
    "chunk_records",
    "default_output",
    "located_messages",
    "message_errors",
    "output_port",
    "reading_errors",
]

MAX_RECORD_BYTES = 64 * 2**20
"""A longer MCAP record is not read: chunks have 192 KiB and a step, or a single image."""

_MAX_RECORDS = 2**18
"""Records of a chunk: ours have some thousands; the smallest take 9 bytes, and each costs a reader 200."""
_MAX_TOPIC_RATIO, _FREE_TOPIC_BYTES = 32, 2**29
"""Bytes of a single topic in memory at once: a multiple of the file's size, or the second number if greater.
"""

_RECORD = struct.Struct("<BQ")
"""Opcode and length of a record."""

_MESSAGE = struct.Struct("<BQHIQQ")
"""Opcode, length, channel, sequence, log time, publish time; the payload follows.

https://mcap.dev/spec#message-op0x05
"""

MESSAGE_HEADER_BYTES = _MESSAGE.size

_MESSAGE_INDEX = struct.Struct("<BQHI")
"""Opcode, length, channel, bytes of the following entries (https://mcap.dev/spec#message-index-op0x07)."""

_INDEX_ENTRY = np.dtype([("time", "<u8"), ("offset", "<u8")])


class BagMessage(NamedTuple):
    """A recorded message."""

    topic: str
    type: str
    time_ns: int
    payload: bytes


def bag_file(path: Path) -> Path:
    """Return the MCAP file at `path`: the file itself, or the file in a rosbag2 directory.

    Raises RecordingError if there is not exactly one file.
    """
    if path.is_dir():
        files = sorted(file for file in path.glob("*.mcap") if file.is_file())  # a pipe would never end
        if len(files) != 1:
            raise RecordingError(
                f"'{path}' holds {len(files)} .mcap files; name a recording's directory, which holds one, or"
                " a file"
            )
        return files[0]
    if not path.is_file():
        raise RecordingError(f"no recording at '{path}'; name a recording's directory or an .mcap file")
    return path


def default_output(recording: Path, ending: str) -> Path:
    """Return the default output beside a recording: `x.png` for the recordings `x` and `x.mcap`.

    Raises RecordingError if there is a link: a file beside a stranger's recording may be the stranger's, and
    lead to any file of the user.
    """
    place = recording.resolve() if recording.name in ("", "..") else recording
    path = place.with_name(f"{place.stem if place.is_file() else place.name}{ending}")
    if path.is_symlink():
        raise RecordingError(f"'{path}' is a link, through which nothing is written: name another --output")
    return path


@contextmanager
def reading_errors(file: Path) -> Generator[None]:
    """Turn the parsers' errors at damaged bytes into a RecordingError with the name of `file`."""
    try:
        yield
    except (RecordingError, GeneratorExit):
        raise
    except OSError as error:
        raise RecordingError(f"cannot read '{file}': {error.strerror}") from error
    except Exception as error:  # struct.error, KeyError, ValueError, and those of zstd and lz4
        raise RecordingError(
            f"'{file}' is damaged ({type(error).__name__}: {error}); `trocar recover {file}` saves what is"
            " whole"
        ) from error


@contextmanager
def message_errors(bag: Bag, topic: str, time_ns: int) -> Generator[None]:
    """Turn a MessageError into a RecordingError with the place of the message."""
    try:
        yield
    except MessageError as error:
        raise RecordingError(f"'{bag.file}': topic '{topic}' at {time_ns} ns: {error}") from error


class Bag:
    """A recording: topics, messages and attachments."""

    def __init__(self, path: str | Path, *, unfinished: bool = False) -> None:
        """Open a rosbag2 directory or an MCAP file.

        `unfinished`: a file cut short, or still being written, is read as far as possible. Raises
        RecordingError if the file is no recording, is cut short, or holds messages in another encoding than
        CDR.
        """
        self.file = bag_file(Path(path))
        self.grown = 0
        """How often `grow` has found more."""
        self._unfinished: Unfinished | None = None
        self.topics: dict[str, str] = {}
        """Type of each topic."""
        self._by_topic: dict[str, set[int]] = {}
        """Channels of each topic."""
        self._known = 0
        """Number of channels in `_by_topic`."""
        self._unpacked: tuple[int, bytes] = (-1, b"")
        """Place and records of the chunk read last: many topics begin in the same chunk."""
        try:
            with reading_errors(self.file):
                self._summary = self._read_summary()
        except CutShortError:
            if not unfinished:
                raise
            self._unfinished = Unfinished(self.file)
            self._summary = self._unfinished.summary
            self.grow()
        self._require_bounded()
        self._read_topics()

    def _require_bounded(self) -> None:
        """Raise RecordingError for a bomb: a file with chunks far larger unpacked, by their own statement."""
        size = self.file.stat().st_size
        stated = sum(index.uncompressed_size for index in self._summary.chunk_indexes)
        if stated > (most := most_unpacked(size)):
            raise RecordingError(
                f"'{self.file}' has {size} bytes and would unpack to {stated}; at most {most} are unpacked:"
                " it is damaged, or made to fill memory"
            )

    @property
    def finished(self) -> bool:
        """Whether the file was whole when opened."""
        return self._unfinished is None

    def grow(self) -> bool:
        """Read on in a file opened before the end of its recording; return whether there is more.

        Raises RecordingError if the file is damaged.
        """
        if self._unfinished is None:
            return False
        with reading_errors(self.file):
            more = self._unfinished.grow()
        if more:
            self.grown += 1
            self._read_topics()
        return more

    def _read_topics(self) -> None:
        for channel in self._summary.channels.values():
            if channel.message_encoding != "cdr":
                raise RecordingError(
                    f"'{self.file}': topic '{channel.topic}' is encoded as '{channel.message_encoding}'; only"
                    " 'cdr' (ROS 2) can be read"
                )
            self.topics[channel.topic] = self._summary.schemas[channel.schema_id].name

    @property
    def counts(self) -> dict[str, int]:
        """Number of messages of each topic."""
        statistics = self._summary.statistics
        counts = Counter({} if statistics is None else statistics.channel_message_counts)
        for index in () if self.finished else self.chunks[-1:]:
            counts.update(one.channel for one in located_messages(self.chunk(index)))
        return {channel.topic: counts.get(channel.id, 0) for channel in self._summary.channels.values()}

    @property
    def duration_ns(self) -> int:
        """Time from the first to the last message."""
        statistics = self._summary.statistics
        return 0 if statistics is None else statistics.message_end_time - statistics.message_start_time

    @cached_property
    def attachments(self) -> dict[str, bytes]:
        """The attachments by name."""
        found: dict[str, bytes] = {}
        with reading_errors(self.file), self.file.open("rb") as stream:
            for index in self._summary.attachment_indexes:
                stream.seek(index.offset)
                record = next(
                    StreamReader(stream, skip_magic=True, record_size_limit=MAX_RECORD_BYTES).records
                )
                if not isinstance(record, Attachment):
                    raise ValueError(f"there is no attachment at {index.offset}")
                found[record.name] = record.data
        return found

    def messages(self, *topics: str) -> Iterator[BagMessage]:
        """Yield the messages of `topics`, or all, in the order of writing.

        Raises RecordingError for a missing topic.
        """
        for _, messages in self.chunked_messages(topics):
            yield from messages

    def chunked_messages(self, topics: Collection[str]) -> Iterator[tuple[ChunkIndex, list[BagMessage]]]:
        """Yield each chunk that may hold messages of `topics`, or all, with the messages.

        Raises RecordingError for a missing topic.
        """
        for topic in topics:
            if topic not in self.topics:
                raise RecordingError(
                    f"'{self.file}' has no topic '{topic}'.{did_you_mean(topic, self.topics)}"
                )
        wanted = {channel: topic for topic in topics or self.topics for channel in self._channel_ids(topic)}
        for chunk, records, found in self._chunks_with_messages(set(wanted)):
            yield (
                chunk,
                [
                    BagMessage(
                        wanted[m.channel],
                        self.topics[wanted[m.channel]],
                        m.time_ns,
                        records[m.offset + MESSAGE_HEADER_BYTES : m.end],
                    )
                    for m in found
                ],
            )

    def column(self, topic: str) -> tuple[NDArray[np.int64], list[bytes]]:
        """Return the times (ns), shape (n,), and the payloads of a topic, in the order of `messages`."""
        times: list[int] = []
        payloads: list[bytes] = []
        left = max(_FREE_TOPIC_BYTES, _MAX_TOPIC_RATIO * self.file.stat().st_size)
        for _, records, found in self._chunks_with_messages(self._channel_ids(topic)):
            left -= sum(m.end - m.offset for m in found)
            if left < 0:
                raise RecordingError(
                    f"'{self.file}': topic '{topic}' is too large to be read at once, or a bomb: it has more"
                    f" than {_MAX_TOPIC_RATIO} times the bytes of the file"
                )
            times += [m.time_ns for m in found]
            payloads += [records[m.offset + MESSAGE_HEADER_BYTES : m.end] for m in found]
        return np.array(times, np.int64), payloads

    @property
    def chunks(self) -> list[ChunkIndex]:
        """The chunks, in the order of the file."""
        return sorted(self._summary.chunk_indexes, key=lambda index: index.chunk_start_offset)

    def chunks_with(self, topic: str) -> list[ChunkIndex]:
        """Return the chunks that may hold messages of `topic`, in the order of the file."""
        ids = self._channel_ids(topic)
        return [
            index
            for index in self.chunks
            if not index.message_index_offsets or not ids.isdisjoint(index.message_index_offsets)
        ]

    def chunk(self, index: ChunkIndex) -> bytes:
        """Return the uncompressed records of a chunk; raises RecordingError for damaged bytes."""
        with reading_errors(self.file), self.file.open("rb") as stream:
            return self._records_of(index, stream)

    def _records_of(self, index: ChunkIndex, stream: BinaryIO) -> bytes:
        place, records = self._unpacked  # another thread may replace both
        if place != index.chunk_start_offset:
            stream.seek(index.chunk_start_offset + _RECORD.size)
            records = chunk_records(Chunk.read(ReadDataStream(stream)))
            self._unpacked = index.chunk_start_offset, records
        return records

    def message_index(self, index: ChunkIndex, topic: str) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return times (ns) and places of the messages of `topic` in a chunk, shape (n,) each.

        Raises RecordingError if the index is damaged.
        """
        ids, places = self._channel_ids(topic), index.message_index_offsets
        if not places:  # another writer's: the chunk itself says it
            with reading_errors(self.file):
                found = [one for one in located_messages(self.chunk(index)) if one.channel in ids]
            return np.array([m.time_ns for m in found], np.int64), np.array(
                [m.offset for m in found], np.int64
            )
        with reading_errors(self.file), self.file.open("rb") as stream:
            entries = [_entries(stream, places[channel], channel) for channel in sorted(ids & places.keys())]
        all_ = np.concatenate(entries) if entries else np.zeros(0, _INDEX_ENTRY)
        return all_["time"].astype(np.int64), all_["offset"].astype(np.int64)

    def payload(self, records: bytes, offset: int) -> bytes:
        """Return the message at a place in the records of a chunk; raises RecordingError if there is none."""
        with reading_errors(self.file):
            found = _message_at(records, offset, set(self._summary.channels))
            return records[found.offset + MESSAGE_HEADER_BYTES : found.end]

    def _channel_ids(self, topic: str) -> set[int]:
        """Return the channels of a topic; a search for each of 20 000 topics would take minutes."""
        channels = self._summary.channels
        if self._known != len(channels):
            found: dict[str, set[int]] = {}
            for one in channels.values():
                found.setdefault(one.topic, set()).add(one.id)
            self._by_topic, self._known = found, len(channels)
        return self._by_topic.get(topic, set())

    def _read_summary(self) -> Summary:
        with self.file.open("rb") as stream:
            size = stream.seek(0, 2)
            stream.seek(0)
            if stream.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
                raise RecordingError(f"'{self.file}' is not an MCAP file")
            stream.seek(max(0, size - len(MCAP0_MAGIC)))
            if size < 2 * len(MCAP0_MAGIC) or stream.read() != MCAP0_MAGIC:
                raise CutShortError(
                    f"'{self.file}' was cut short; `trocar recover {self.file}` saves what is whole"
                )
            stream.seek(0)
            summary = SeekingReader(stream, record_size_limit=MAX_RECORD_BYTES).get_summary()
        if summary is None or (
            not summary.chunk_indexes and summary.statistics is not None and summary.statistics.message_count
        ):
            raise RecordingError(f"'{self.file}' has no chunk index; `trocar recover {self.file}` writes one")
        return summary

    def _chunks_with_messages(
        self, wanted: set[int]
    ) -> Iterator[tuple[ChunkIndex, bytes, list[LocatedMessage]]]:
        """Yield, in file order, each chunk with `wanted` channels, the records, and the places."""
        indexes = sorted(self._summary.chunk_indexes, key=lambda index: index.chunk_start_offset)
        with self.file.open("rb") as stream:
            for index in indexes:
                places = index.message_index_offsets
                if places and wanted.isdisjoint(places):
                    continue
                with reading_errors(self.file):
                    records = self._records_of(index, stream)
                    if wanted.issuperset(places):
                        found = [m for m in located_messages(records) if m.channel in wanted]
                    else:
                        offsets = [
                            o for c in wanted & places.keys() for o in _message_offsets(stream, places[c], c)
                        ]
                        found = [_message_at(records, offset, wanted) for offset in sorted({*offsets})]
                yield index, records, found


class LocatedMessage(NamedTuple):
    """The place of a message in the records of a chunk."""

    channel: int
    time_ns: int
    offset: int
    """Start of the record."""
    end: int


def _message_offsets(stream: BinaryIO, place: int, channel: int) -> list[int]:
    """Return where the messages of `channel` start in their chunk, from the message index at `place`."""
    return _entries(stream, place, channel)["offset"].tolist()


def _entries(stream: BinaryIO, place: int, channel: int) -> NDArray[np.void]:
    """Return time and place in their chunk of the messages of `channel`, from the index at `place`."""
    stream.seek(place)
    opcode, length, stated, size = _MESSAGE_INDEX.unpack(stream.read(_MESSAGE_INDEX.size))
    if (opcode, stated, length) != (Opcode.MESSAGE_INDEX, channel, size + 6) or length > MAX_RECORD_BYTES:
        raise ValueError(f"there is no index of channel {channel} at {place}")
    return np.frombuffer(stream.read(size), _INDEX_ENTRY)


def _message_at(records: bytes, offset: int, channels: set[int]) -> LocatedMessage:
    opcode, length, channel, _, time_ns, _ = _MESSAGE.unpack_from(records, offset)
    end = offset + _RECORD.size + length
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
            stream = ReadDataStream(BytesIO(records[at + _RECORD.size : end]))
            yield Schema.read(stream) if opcode == Opcode.SCHEMA else Channel.read(stream)


def _record_heads(records: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield opcode, start and end of each record of a chunk."""
    at = count = 0
    while at < len(records):
        opcode, length = _RECORD.unpack_from(records, at)
        end, count = at + _RECORD.size + length, count + 1
        if end > len(records):
            raise ValueError(f"a record of {length} bytes at {at} passes the end of its chunk")
        if count > _MAX_RECORDS:
            raise ValueError(f"a chunk has more than {_MAX_RECORDS} records")
        yield opcode, at, end
        at = end


def output_port(name: str, type_name: str, payload: bytes) -> Port:
    """Return the output port for messages such as `payload`.

    Types with a fixed layout are signals, with frame, joint names and sizes as in `payload`; all remaining
    types events. Raises MessageError.
    """
    model = message_type(type_name)
    if not has_vector(type_name):
        return Port(name=name, causality="output", type=type_name, variability="event")
    message = decode(model, payload)
    known: dict[str, Any] = {}
    if isinstance(message, ros.JointState):
        sizes = {field: getattr(message, field).size for field in ("position", "velocity", "effort")}
        known = {
            "names": tuple(message.name),
            "fields": tuple(field for field in sizes if sizes[field]) or ("position",),
            "size": max(1, *sizes.values()),
        }
    elif isinstance(message, ros.Float64MultiArray):
        known = {"size": max(1, message.data.size)}
    header = getattr(message, "header", None)
    frame = header.frame_id if isinstance(header, ros.Header) else ""
    return Port(name=name, causality="output", type=type_name, frame=frame, **known)
