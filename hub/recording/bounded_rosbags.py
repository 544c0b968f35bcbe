"""Bounds for `rosbags`: the library unpacks chunks and messages of a bag whole, whatever their unpacked size.

Our decompressors take the places of the library's, and refuse large results.
"""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace

import rosbags.rosbag1.reader as ros1
import rosbags.rosbag2.reader as ros2
import rosbags.rosbag2.storage_mcap as mcap

from hub.recording.unpacking import MAX_CHUNK_BYTES, unpack

__all__ = ["bound_rosbags"]


def bound_rosbags() -> None:
    """Replace the decompressors of `rosbags`. May be called again."""
    for name in ("lz4", "bz2"):
        ros1.decompressors[name] = partial(unpack, name)
    for name in ("lz4", "zstd"):
        mcap.DECOMPRESSORS[name] = partial(_unpack_stated, name)
    names = ros2.__dict__  # it imports `zstd` from where its version of Python has it
    names["zstd"] = SimpleNamespace(open=names["zstd"].open, decompress=partial(unpack, "zstd"))


def _unpack_stated(compression: str, packed: bytes, size: int) -> bytes:
    return unpack(compression, packed, min(size, MAX_CHUNK_BYTES))
