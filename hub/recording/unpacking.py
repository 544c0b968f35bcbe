"""Unpacking with a bound: compressed bytes of a stranger may be a bomb, whatever their stated size."""

from __future__ import annotations

import bz2

import lz4.frame
import zstandard

__all__ = ["MAX_CHUNK_BYTES", "most_unpacked", "unpack"]

MAX_CHUNK_BYTES = 64 * 2**20
"""Unpacked size of a chunk or message: ours have 256 KiB, chunks of ROS and Foxglove some MiB or a picture.
"""

_RATIO = 255
"""Greatest ratio of lz4: a byte of a match stands for 255 bytes at most (lz4_Block_format.md)."""
_FREE_BYTES = 256 * 2**20
"""Unpacked size of a file with any ratio."""
_MAX_WINDOW_BYTES = 2**27
"""Memory for a zstd frame, as the program `zstd` allows by default (ZSTD_WINDOWLOG_LIMIT_DEFAULT)."""


def most_unpacked(packed_bytes: int) -> int:
    """Return how many bytes a whole file may unpack to."""
    return max(_FREE_BYTES, _RATIO * packed_bytes)


def unpack(compression: str, packed: bytes, most: int = MAX_CHUNK_BYTES) -> bytes:
    """Return uncompressed bytes; at most `most` + 1 bytes are ever in memory.

    Raises ValueError if there are more or fewer than a whole frame, or for an unknown compression; and the
    decompressors' errors.
    """
    if compression == "lz4":
        frame = lz4.frame.LZ4FrameDecompressor()
        data, whole = frame.decompress(packed, max_length=most + 1), frame.eof
    elif compression == "bz2":
        blocks = bz2.BZ2Decompressor()
        data, whole = blocks.decompress(packed, max_length=most + 1), blocks.eof
    elif compression == "zstd":
        stream = zstandard.ZstdDecompressor(max_window_size=_MAX_WINDOW_BYTES)
        data = stream.stream_reader(packed, read_across_frames=True).read(most + 1)
        whole = True  # a frame that is cut short has fewer bytes, which its reader counts
    elif compression:
        raise ValueError(f"compression '{compression[:20]}'; expected none, lz4, zstd or bz2")
    else:
        data, whole = packed, True
    if len(data) > most:
        raise ValueError(f"more than the {most} bytes that are allowed come out of {len(packed)} bytes")
    if not whole:
        raise ValueError("its compressed bytes are cut short")
    return data
