"""Saves the complete part of a recording cut short: attachments, channels and whole chunks."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.exceptions import McapError
from mcap.records import Attachment, Channel, Chunk, Footer, McapRecord, Message, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC

from hub.recording.bag_files import bag_file, default_output, reading_errors
from hub.recording.chunk import ChunkData
from hub.recording.located_messages import (
    MAX_RECORD_BYTES,
    chunk_declarations,
    chunk_records,
    located_messages,
)
from hub.recording.mcap_file import McapFile, create_bag, write_rosbag2_metadata
from schemas.errors import RecordingError

__all__ = ["RecoverSummary", "recover"]


@dataclass(frozen=True)
class RecoverSummary:
    """Counts of the saved and the damaged part."""

    path: Path
    """The new rosbag2 directory."""
    cut_short: bool
    """The file had no footer: the recorder did not close the file."""
    attachments: int
    chunks: int
    messages: int
    damaged_chunks: int
    """Chunks whole in the file but with a wrong checksum; left out of the copy."""
    end_ns: int
    """Simulated time of the last message saved."""


def recover(path: Path, output: Path | None = None) -> RecoverSummary:
    """Write the complete part of the recording at `path` to the new rosbag2 directory `output`.

    The default is the name of the recording with `-recovered` appended. Raises RecordingError if `path` is
    not a recording, or if `output` is not empty or cannot be written.
    """
    source = bag_file(path)
    with reading_errors(source), source.open("rb") as stream:
        if stream.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
            raise RecordingError(f"'{source}' is not an MCAP file")
    target = create_bag(output or default_output(path, "-recovered"))
    try:
        copy = _Copy(target)
        with source.open("rb") as stream:
            reader = StreamReader(stream, emit_chunks=True, record_size_limit=MAX_RECORD_BYTES)
            for record in _whole_records(reader):
                copy.add(record)
        target.finish()
        write_rosbag2_metadata(target)
    except OSError as error:
        raise RecordingError(f"cannot recover '{source}' to '{target.path}': {error.strerror}") from error
    finally:
        target.close()
    statistics = target.statistics
    return RecoverSummary(
        path=target.path.parent,
        cut_short=not copy.footer,
        attachments=statistics.attachment_count,
        chunks=statistics.chunk_count,
        messages=statistics.message_count,
        damaged_chunks=copy.damaged,
        end_ns=statistics.message_end_time,
    )


def _whole_records(reader: StreamReader) -> Iterator[McapRecord]:
    """Yield the records up to the first incomplete record; a record may state any length."""
    with suppress(McapError, struct.error, ValueError, OverflowError, MemoryError):
        yield from reader.records


class _Copy:
    """Copies the records of the damaged file to the new file."""

    def __init__(self, target: McapFile) -> None:
        self.target = target
        self.damaged = 0
        self.footer = False
        self._schemas: dict[int, Schema] = {}
        self._declared: set[int] = set()

    def add(self, record: McapRecord) -> None:
        """Copy a record; the records of the summary are written anew."""
        if isinstance(record, Attachment):
            self.target.attach(record.name, record.data)
        elif isinstance(record, Schema):
            self._schemas[record.id] = record
        elif (
            isinstance(record, Channel)
            and record.id not in self._declared
            and record.schema_id in self._schemas
        ):
            self._declared.add(record.id)
            self.target.declare(self._schemas[record.schema_id], record)
        elif isinstance(record, Chunk):
            self._add_chunk(record)
        elif isinstance(record, Message):
            raise RecordingError(
                "messages that stand outside chunks: not a recording of Trocar; use `mcap recover` of the"
                " MCAP project"
            )
        elif isinstance(record, Footer):
            self.footer = True

    def _add_chunk(self, chunk: Chunk) -> None:
        try:
            records = chunk_records(chunk)
            table = np.array([m[:3] for m in located_messages(records)], np.int64).reshape(-1, 3)
            others = list(chunk_declarations(records))
        except Exception:  # noqa: BLE001 - wrong bytes make zstd, lz4, struct and mcap raise what they please; counted, and reported
            self.damaged += 1
            return
        for record in others:
            self.add(record)
        if len(table):
            self.target.add_chunk(ChunkData(records, table[:, 0], table[:, 1], table[:, 2]))
