"""Records a session to a rosbag2 directory without slowing its steps.

`write` puts a message into a bounded queue; a thread builds chunks of them, compresses and writes these
(docs/decisions/0005-recorder.md). Nothing is lost silently: a message that does not fit into the queue, or
arrives when the disk is full, is counted, logged once, and marks the recording as incomplete.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from threading import Event, Lock, Thread
from types import TracebackType
from typing import Self

from mcap.records import Channel, Schema

from hub.recording.bag import MESSAGE_HEADER_BYTES
from hub.recording.mcap_file import chunk_data, create_bag, write_rosbag2_metadata
from schemas.codec import rihs01, ros2msg_definition, typestore
from schemas.errors import RecordingError, did_you_mean

__all__ = ["Recorder", "RecorderSummary"]

CHUNK_BYTES = 64 * 2**10
"""A killed process loses about this much.

Small, so that building a chunk does not hold the interpreter for long, which the step loop needs
(docs/decisions/0005-recorder.md).
"""

CHUNK_AGE_S = 1.0
"""A chunk is written after this much wall time at the latest."""

MAX_QUEUED_BYTES = 64 * 2**20
MAX_QUEUED_MESSAGES = 250_000
"""If more than either waits for the disk, messages are dropped."""

_log = logging.getLogger(__name__)

_Queued = tuple[int, int, bytes]


@dataclass(frozen=True)
class RecorderSummary:
    """What a recorder did."""

    path: Path
    """The rosbag2 directory."""
    complete: bool
    """Every message given to the recorder is in the file, and the file is finished."""
    messages: int
    """Messages in the file."""
    dropped: int
    """Messages that are not in the file."""
    bytes: int
    """Size of the file."""
    error: str | None
    """Why recording stopped, if it did."""


class Recorder:
    """Writes channels of CDR messages, all stamped in simulated nanoseconds, to a rosbag2 directory."""

    def __init__(self, directory: Path, *, attachments: Mapping[str, bytes]) -> None:
        """Create the directory and write the attachments, which come first so that they survive a crash.

        Raises RecordingError if the directory holds something, or if it cannot be written.
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
        self._queue: list[_Queued] = []
        self._queued_bytes = 0
        self._dropped = 0
        self._error: str | None = None
        self._closing = False
        self._refusing = False
        self._summary: RecorderSummary | None = None
        self._thread = Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    def channel(self, topic: str, type_name: str) -> int:
        """Return the number under which messages of `topic` are written.

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

    def write(self, channel: int, time_ns: int, payload: bytes) -> None:
        """Queue one message. Never waits for the disk; may be called from any thread."""
        self.write_all([(channel, time_ns, payload)])

    def write_all(self, messages: Sequence[tuple[int, int, bytes]]) -> None:
        """Queue messages, each (channel, time in ns, payload), all or none of them, as `write` does one."""
        size = sum(MESSAGE_HEADER_BYTES + len(payload) for _, _, payload in messages)
        with self._lock:
            before = self._queued_bytes
            if self._refusing or before > MAX_QUEUED_BYTES or len(self._queue) >= MAX_QUEUED_MESSAGES:
                self._drop(len(messages))
                return
            self._queue += messages
            self._queued_bytes = after = before + size
        if before < CHUNK_BYTES <= after:
            self._wake.set()

    def close(self) -> RecorderSummary:
        """Write what is queued, the summary section and `metadata.yaml`. May be called twice."""
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
                queue, self._queue, self._queued_bytes = self._queue, [], 0
                channels = list(self._channels)
            if self._error is not None:  # what was queued before the error was known must leave no gap behind it
                self._dropped += len(queue)
                continue
            written = 0
            try:
                self._declare(channels)
                for part in _chunks(queue):
                    self._file.add_chunk(chunk_data(part))
                    written += len(part)
            except Exception as error:  # noqa: BLE001 - whatever it is, the session goes on and the recording is marked
                self._fail(error)
                self._dropped += len(queue) - written

    def _declare(self, channels: Sequence[tuple[str, str]]) -> None:
        """Write the channels that are not in the file yet."""
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


def _chunks(queue: Sequence[_Queued]) -> Iterator[Sequence[_Queued]]:
    """Cut `queue` into parts of at most about `CHUNK_BYTES`, each with at least one message."""
    start, size = 0, 0
    for end, (_, _, payload) in enumerate(queue, 1):
        size += MESSAGE_HEADER_BYTES + len(payload)
        if size >= CHUNK_BYTES:
            yield queue[start:end]
            start, size = end, 0
    if start < len(queue):
        yield queue[start:]
