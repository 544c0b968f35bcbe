"""Reads MCAP recordings of ROS 2 messages, of Trocar and ROS tools. Nothing in the files is trusted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Generator, Iterator
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.reader import SeekingReader
from mcap.records import Attachment, Chunk, ChunkIndex
from mcap.stream_reader import StreamReader
from mcap.summary import Summary
from mcap.writer import MCAP0_MAGIC
from numpy.typing import NDArray

from hub.recording.bag_files import bag_file, reading_errors
from hub.recording.located_messages import (
    INDEX_ENTRY,
    MAX_RECORD_BYTES,
    MESSAGE_HEADER_BYTES,
    RECORD_HEAD,
    LocatedMessage,
    chunk_records,
    index_entries,
    located_messages,
    message_at,
)
from hub.recording.unfinished import Unfinished
from hub.recording.unpacking import most_unpacked
from schemas.errors import CutShortError, MessageError, RecordingError, did_you_mean

__all__ = ["Bag", "BagMessage", "message_errors"]

_MAX_TOPIC_RATIO, _FREE_TOPIC_BYTES = 32, 2**29
"""Bytes of a single topic in memory at once: a multiple of the file's size, or the second number if greater.
"""


class BagMessage(NamedTuple):
    """A recorded message."""

    topic: str
    type: str
    time_ns: int
    payload: bytes


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
            stream.seek(index.chunk_start_offset + RECORD_HEAD.size)
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
            entries = [
                index_entries(stream, places[channel], channel) for channel in sorted(ids & places.keys())
            ]
        all_ = np.concatenate(entries) if entries else np.zeros(0, INDEX_ENTRY)
        return all_["time"].astype(np.int64), all_["offset"].astype(np.int64)

    def payload(self, records: bytes, offset: int) -> bytes:
        """Return the message at a place in the records of a chunk; raises RecordingError if there is none."""
        with reading_errors(self.file):
            found = message_at(records, offset, set(self._summary.channels))
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
                            index_entries(stream, places[one], one)["offset"]
                            for one in sorted(wanted & places.keys())
                        ]
                        starts = np.unique(np.concatenate(offsets)).tolist()
                        found = [message_at(records, start, wanted) for start in starts]
                yield index, records, found
