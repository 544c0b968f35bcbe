"""Chunks of an MCAP file with other compressed bytes, another stated size or another compression.

The places of all records in the summary follow, so that readers come as far as the chunk.
"""

from __future__ import annotations

import random
from collections.abc import Mapping
from io import BytesIO

import lz4.frame
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import Chunk, ChunkIndex, DataEnd, Footer, SummaryOffset
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC

from tests.fuzz.byte_mutations import NUMBERS, mutated
from tests.hub.recording.packed_zeros import MiB, packed_zeros

__all__ = ["Bombs", "make_bombs", "with_other_chunk"]

_SIZES = {"lz4": (16, 1000), "zstd": (16, 1000), "bz2": (16, 200)}
"""Unpacked sizes in MiB: below the limit of a chunk, and far above."""

Bombs = Mapping[tuple[str, int], bytes]
"""Compressed zeros by compression and unpacked size in bytes."""


def make_bombs() -> Bombs:
    """Compress zeros in all ways and sizes."""
    wanted = [(name, number * MiB) for name, numbers in _SIZES.items() for number in numbers]
    return {(name, size): packed_zeros(name, size) for name, size in wanted}


def with_other_chunk(data: bytes, source: random.Random, bombs: Bombs) -> tuple[str, bytes]:
    """Return what was done to one chunk of a sound file, and the file."""
    records = list(StreamReader(BytesIO(data), emit_chunks=True).records)
    chunk = source.choice([record for record in records if isinstance(record, Chunk)])
    before = len(chunk.data) + len(chunk.compression.encode())
    label = _change(chunk, source, bombs)
    longer = len(chunk.data) + len(chunk.compression.encode()) - before
    start, builder, written = 0, RecordBuilder(), bytearray(MCAP0_MAGIC)
    for record in records:
        if record is chunk:
            start = len(written)
        elif isinstance(record, ChunkIndex) and record.chunk_start_offset >= start:
            _move(record, start, longer, chunk)
        elif isinstance(record, SummaryOffset):
            record.group_start += longer
        elif isinstance(record, DataEnd) and source.random() < 0.15:
            return f"{label}+cut", bytes(written)
        elif isinstance(record, Footer):
            record = Footer(record.summary_start + longer, record.summary_offset_start + longer, 0)
        record.write(builder)
        written += builder.end()
    return label, bytes(written + MCAP0_MAGIC)


def _change(chunk: Chunk, source: random.Random, bombs: Bombs) -> str:
    """Change a chunk and return what was done."""
    chunk.uncompressed_crc = 0
    true_size = chunk.uncompressed_size
    change = source.choice(["bomb", "bomb", "behind", "bytes", "size", "name"])
    name, size = source.choice(list(bombs))
    match change:
        case "bomb":
            chunk.compression, chunk.data = name, bombs[name, size]
            true_size, change = size, f"bomb of {size // MiB} MiB by {name}"
        case "behind":  # a reader of zstd may go on from frame to frame
            size = source.choice([size for name, size in bombs if name == "zstd"])
            records = zstandard.compress(lz4.frame.decompress(chunk.data))
            chunk.compression, chunk.data = "zstd", records + bombs["zstd", size]
            true_size, change = true_size + size, f"bomb of {size // MiB} MiB behind the records"
        case "bytes":
            label, chunk.data = mutated(chunk.data, source)
            change = f"compressed {label}"
        case "name":
            chunk.compression = source.choice(["", "lz4", "zstd", "bz2", "none", "LZ4", "z" * 5000])
        case _:
            pass
    if change == "size" or source.random() < 0.5:
        chunk.uncompressed_size = source.choice([*NUMBERS, 2**63, 2**64 - 1])
        return f"{change}, states {chunk.uncompressed_size} bytes"
    chunk.uncompressed_size = true_size
    return change


def _move(index: ChunkIndex, start: int, longer: int, chunk: Chunk) -> None:
    """Let an index name the places after the chunk at `start` was changed."""
    if index.chunk_start_offset == start:
        index.chunk_length += longer
        index.compression, index.compressed_size = chunk.compression, len(chunk.data)
        index.uncompressed_size = chunk.uncompressed_size
    else:
        index.chunk_start_offset += longer
    index.message_index_offsets = {
        channel: offset + longer for channel, offset in index.message_index_offsets.items()
    }
