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
_MAX_HEAD_BYTES = 18
"""Longest header of a zstd frame, with the magic number (ZSTD_FRAMEHEADERSIZE_MAX)."""
_SKIPPABLE = b"\x2a\x4d\x18"
"""Bytes 1 to 3 of a zstd frame without contents."""


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
        whole = len(data) > most or _are_whole_frames(packed)
    elif compression:
        raise ValueError(f"compression '{compression[:20]}'; expected none, lz4, zstd or bz2")
    else:
        data, whole = packed, True
    if len(data) > most:
        raise ValueError(f"more than the {most} bytes that are allowed come out of {len(packed)} bytes")
    if not whole:
        raise ValueError("its compressed bytes are cut short")
    return data


def _are_whole_frames(packed: bytes) -> bool:
    """Return whether zstd frames, valid as far as they go, end where `packed` ends; no frame is not whole."""
    at = 0
    while at < len(packed):
        at = _frame_end(packed, at)
    return 0 < at == len(packed)


def _frame_end(packed: bytes, at: int) -> int:
    """Return the end of the zstd frame at `at`; behind the end of `packed` if the frame is cut short.

    https://www.rfc-editor.org/rfc/rfc8878#section-3.1
    """
    head = packed[at : at + _MAX_HEAD_BYTES]
    if head[1:4] == _SKIPPABLE:
        return at + 8 + int.from_bytes(head[4:8], "little")
    at += zstandard.frame_header_size(head)
    is_last = False
    while not is_last and at <= len(packed):
        block = int.from_bytes(packed[at : at + 3], "little")
        is_last, is_repeated_byte, size = bool(block & 1), block >> 1 & 3 == 1, block >> 3
        at += 3 + (1 if is_repeated_byte else size)
    return at + (4 if zstandard.get_frame_parameters(head).has_checksum else 0)
