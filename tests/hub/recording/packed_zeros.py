"""Small files that unpack to many zeros."""

import bz2

import lz4.frame
import zstandard

MiB = 2**20


def packed_zeros(compression: str, size: int) -> bytes:
    """Return `size` zeros, compressed piece by piece."""
    piece = bytes(MiB)
    if compression == "lz4":
        with lz4.frame.LZ4FrameCompressor() as frame:
            begin = frame.begin()
            return begin + b"".join(frame.compress(piece) for _ in range(size // MiB)) + frame.flush()
    if compression == "zstd":
        packer = zstandard.ZstdCompressor(level=19).compressobj()
    else:
        packer = bz2.BZ2Compressor()
    return b"".join(packer.compress(piece) for _ in range(size // MiB)) + packer.flush()
