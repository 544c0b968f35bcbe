"""The messages of GStreamer's unixfd elements: a header, a payload, and file descriptors beside it.

Read from GStreamer 1.26 (subprojects/gst-plugins-bad/gst/unixfd, gstmeta.c), whose numbers are those of the
machine: little-endian. 1.24 ignores metadata.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping

from schemas.errors import MessageError

__all__ = [
    "END_OF_STREAM",
    "buffer_message",
    "caps_message",
    "picture_caps",
    "released_buffers",
    "timestamps",
]

_NEW_BUFFER, _RELEASE_BUFFER, _CAPS, _END_OF_STREAM = range(4)
_HEADER = struct.Struct("<II")
"""Command, bytes of the payload."""
_BUFFER = struct.Struct("<6QI2BH2Q")
"""Id, PTS, DTS, duration, offset, end of offset; flags, type of memory, number of memories and of metadata;
size and offset of the only memory.
"""
_RELEASED = struct.Struct("<Q")
_NONE = 2**64 - 1
"""GStreamer's number for no time."""
_LONGEST = 4096
"""Bytes of a message from a reader; the only one has 16."""
_TIMESTAMPS = "DataCollectionFrameTimestamps"
"""Name of the metadata of dvrk_data (include/dvrk_data/cpu_timestamp_meta.hpp)."""
_STAGES = ("mono-source", "left-source", "right-source", "stereo-output", "overlay-output")

END_OF_STREAM = _HEADER.pack(_END_OF_STREAM, 0)


def picture_caps(width: int, height: int, frame_rate: int, colorimetry: str) -> str:
    """Return the format of pictures in I420, in GStreamer's words."""
    return (
        f"video/x-raw, format=(string)I420, width=(int){width}, height=(int){height},"
        f" framerate=(fraction){frame_rate}/1, pixel-aspect-ratio=(fraction)1/1,"
        f" interlace-mode=(string)progressive, colorimetry=(string){colorimetry}"
    )


def caps_message(caps: str) -> bytes:
    """Return the message that states the format of the pictures after it."""
    payload = caps.encode() + b"\0"
    return _HEADER.pack(_CAPS, len(payload)) + payload


def buffer_message(number: int, time_ns: int, size: int, metadata: bytes) -> bytes:
    """Return the message of a picture in one memory of `size` bytes, whose descriptor goes beside it.

    Args:
        number: by which the reader releases the picture.
        time_ns: of the monotonic clock.
        size: bytes.
        metadata: as `timestamps` returns it.
    """
    fields = _BUFFER.pack(
        number, time_ns, _NONE, _NONE, number, number + 1, 0, 0, 1, 1 if metadata else 0, size, 0
    )
    return _HEADER.pack(_NEW_BUFFER, len(fields) + len(metadata)) + fields + metadata


def timestamps(times_ns: Mapping[str, int]) -> bytes:
    """Return the metadata with times of CLOCK_REALTIME by stage: `left-source`, `stereo-output`."""
    fields = ", ".join(f"{stage}-ts=(gint64){times_ns.get(stage, 0)}" for stage in _STAGES)
    content = f"{_TIMESTAMPS}, {fields};".encode() + b"\0"
    name = _TIMESTAMPS.encode()
    head = struct.pack("<I", len(name)) + name + b"\0\0"  # the end of the name, and version 0
    return struct.pack("<I", 4 + len(head) + len(content)) + head + content


def released_buffers(received: bytearray) -> Iterator[int]:
    """Yield the numbers of released pictures, and take their messages from `received`.

    Raises MessageError for what no reader sends.
    """
    while len(received) >= _HEADER.size:
        command, size = _HEADER.unpack_from(received)
        if size > _LONGEST:
            raise MessageError(f"a message of {size} bytes; at most {_LONGEST} are read")
        if len(received) < _HEADER.size + size:
            return
        payload = bytes(received[_HEADER.size : _HEADER.size + size])
        del received[: _HEADER.size + size]
        if command == _RELEASE_BUFFER:
            if size < _RELEASED.size:
                raise MessageError(f"a release of {size} bytes; {_RELEASED.size} are expected")
            yield _RELEASED.unpack_from(payload)[0]
        elif command in (_NEW_BUFFER, _CAPS):
            raise MessageError(f"command {command}, which only a source sends")
