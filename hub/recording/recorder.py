"""Records a session to a rosbag2 directory without slowing the steps.

`write` puts a message into a bounded queue, or many vectors at once; a thread builds, compresses and writes
chunks (docs/decisions/0005-recorder.md, docs/decisions/0049-recorder-by-blocks.md). Nothing is lost silently:
a message too large for the rest of the queue, or arrives when the disk is full, is counted, logged once, and
marks the recording as incomplete.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from threading import Event, Lock, Thread
from types import TracebackType
from typing import Self

from mcap.records import Channel, Schema

from hub.recording.chunk import FIRST_BLOCK, Queued, chunk_data
from hub.recording.located_messages import MESSAGE_HEADER_BYTES
from hub.recording.mcap_file import create_bag, write_rosbag2_metadata
from hub.recording.vector_block import VectorBlock
from schemas.codec import rihs01, ros2msg_definition, typestore
from schemas.errors import RecordingError, did_you_mean
from schemas.vectors import VectorCodec

__all__ = ["Recorder", "RecorderSummary"]

CHUNK_BYTES = 192 * 2**10
"""A chunk is made when this much is there, so a killed process loses about this much.

Vectors of many steps are laid out by a few calls of numpy, whatever their number: of a chunk of 64 KiB these
calls were two fifths of the cost (docs/decisions/0061-fewer-calls.md).
"""

MOST_CHUNK_BYTES = 256 * 2**10
"""Messages queued until the thread's turn go into the same chunk, up to this size."""

CHUNK_AGE_S = 1.0
"""A chunk is written after this much wall time at the latest."""

MAX_QUEUED_BYTES = 64 * 2**20
MAX_QUEUED_MESSAGES = 250_000
"""If more than either waits for the disk, messages are dropped."""

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class RecorderSummary:
    """Counts, size and errors of a recording."""

    path: Path
    """The rosbag2 directory."""
    complete: bool
    """Every message given to the recorder is in the file, and the file is finished."""
    messages: int
    """Messages in the file."""
    dropped: int
    """Messages missing in the file."""
    bytes: int
    """Size of the file."""
    error: str | None
    """Why recording stopped early, else None."""


class Recorder:
    """Writes channels of CDR messages, all stamped in simulated nanoseconds, to a rosbag2 directory."""

    def __init__(self, directory: Path, *, attachments: Mapping[str, bytes]) -> None:
        """Create the directory and write the attachments: first, so that a crash does not lose them.

        Raises RecordingError if the directory holds something, or cannot be written.
        """
        self.directory = directory
        self._file = create_bag(directory)
        try:
            for name, data in attachments.items():
                self._file.attach(name, data)
        except OSError as error:
            self._file.close()
            raise RecordingError(f"cannot record to '{directory}': {error.strerror}") from error
        self._lock = Lock()
        self._wake = Event()
        self._channels: list[tuple[str, str]] = []
        self._blocks: list[VectorBlock] = []
        self._queue: list[Queued] = []
        self._queued_bytes = 0
        self._dropped = 0
        self._error: str | None = None
        self._closing = False
        self._refusing = False
        self._summary: RecorderSummary | None = None
        self._thread = Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    def add_channel(self, topic: str, type_name: str) -> int:
        """Return the number of the messages of `topic` for `write`.

        Raises RecordingError for an unknown type.
        """
        if type_name not in typestore().types:
            raise RecordingError(
                f"cannot record '{topic}': unknown message type"
                f" '{type_name}'.{did_you_mean(type_name, typestore().types)}"
            )
        with self._lock:
            if (topic, type_name) not in self._channels:
                self._channels.append((topic, type_name))
            return self._channels.index((topic, type_name)) + 1

    def add_block(self, vectors: Sequence[tuple[int, VectorCodec]]) -> int:
        """Return the number for `write` of vectors written together as bytes; each vector has its channel."""
        with self._lock:
            self._blocks.append(VectorBlock(vectors))
            return FIRST_BLOCK + len(self._blocks) - 1

    def write(self, number: int, time_ns: int, content: bytes) -> None:
        """Queue the message of a channel, or the vectors of a block in their order.

        Never waits for the disk; may be called from any thread.
        """
        self.write_all([(number, time_ns, content)])

    def write_all(self, queued: Sequence[Queued]) -> None:
        """Queue messages and vectors, all or none of them, like `write`."""
        size = sum(self._record_sizes(queued))
        with self._lock:
            before = self._queued_bytes
            if self._refusing or before > MAX_QUEUED_BYTES or len(self._queue) >= MAX_QUEUED_MESSAGES:
                self._drop(self._messages(queued))
                return
            self._queue += queued
            self._queued_bytes = after = before + size
        if before < CHUNK_BYTES <= after:
            self._wake.set()

    def _record_sizes(self, queued: Iterable[Queued]) -> list[int]:
        """Return the size of each queued message or block as records, bytes."""
        blocks = self._blocks
        return [
            MESSAGE_HEADER_BYTES + len(content) if number < FIRST_BLOCK else blocks[number - FIRST_BLOCK].size
            for number, _, content in queued
        ]

    def _messages(self, queued: Iterable[Queued]) -> int:
        """Return the number of messages."""
        return sum(
            1 if number < FIRST_BLOCK else len(self._blocks[number - FIRST_BLOCK].channels)
            for number, _, _ in queued
        )

    def close(self) -> RecorderSummary:
        """Write the rest of the queue, the summary section and `metadata.yaml`. May be called twice."""
        with self._lock:
            self._closing = self._refusing = True
        self._wake.set()
        self._thread.join()
        if self._summary is None:
            try:
                self._file.finish()
                write_rosbag2_metadata(self._file)
            except OSError as error:
                self._fail(error)
            self._file.close()
            complete = self._error is None and not self._dropped
            messages = self._file.statistics.message_count
            self._summary = RecorderSummary(
                self.directory, complete, messages, self._dropped, self._file.size, self._error
            )
        return self._summary

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _run(self) -> None:
        while not self._closing or self._queue:
            self._wake.wait(CHUNK_AGE_S)
            self._wake.clear()
            with self._lock:
                queue, self._queue = self._queue, []
                size, self._queued_bytes = self._queued_bytes, 0
                channels = list(self._channels)
            if (
                self._error is not None
            ):  # what was queued before the error was known must leave no gap behind it
                self._dropped += self._messages(queue)
                continue
            written = 0
            try:
                self._declare_channels(channels)
                for part in self._split_queue(queue, size):
                    self._file.add_chunk(chunk_data(part, self._blocks))
                    written += len(part)
            except Exception as error:  # noqa: BLE001 - whatever it is, the session goes on and the recording is marked
                self._fail(error)
                self._dropped += self._messages(queue[written:])

    def _split_queue(self, queue: list[Queued], queued_bytes: int) -> Iterator[list[Queued]]:
        """Cut `queue` into parts of at most `MOST_CHUNK_BYTES`, each with at least a message."""
        if 0 < queued_bytes <= MOST_CHUNK_BYTES:
            yield queue
            return
        start, size = 0, 0
        for place, more in enumerate(self._record_sizes(queue)):
            if size and size + more > MOST_CHUNK_BYTES:
                yield queue[start:place]
                start, size = place, 0
            size += more
        if start < len(queue):
            yield queue[start:]

    def _declare_channels(self, channels: Sequence[tuple[str, str]]) -> None:
        """Write the channels still missing in the file."""
        for number, (topic, type_name) in enumerate(
            channels[len(self._file.channels) :], len(self._file.channels) + 1
        ):
            names = [schema.name for schema in self._file.schemas]
            schema_id = names.index(type_name) + 1 if type_name in names else len(names) + 1
            schema = Schema(schema_id, ros2msg_definition(type_name).encode(), "ros2msg", type_name)
            self._file.declare(
                schema,
                Channel(
                    number,
                    topic,
                    "cdr",
                    {"offered_qos_profiles": "", "topic_type_hash": rihs01(type_name)},
                    schema_id,
                ),
            )

    def _drop(self, count: int) -> None:
        self._dropped += count
        if self._dropped == count and not self._error:
            why = "it is closed" if self._closing else f"{len(self._queue)} messages wait for the disk"
            _log.error(
                "recorder of '%s' drops messages, because %s: the recording is incomplete",
                self.directory,
                why,
            )

    def _fail(self, error: Exception) -> None:
        self._refusing = True
        if self._error is None:
            self._error = (
                error.strerror
                if isinstance(error, OSError) and error.strerror
                else f"{type(error).__name__}: {error}"
            )
            _log.error(
                "recording to '%s' has stopped: %s. The session goes on; its recording is incomplete",
                self.directory,
                self._error,
            )
