"""Frames between a camera and the process that draws for it: a JSON header, and bytes."""

from __future__ import annotations

import json
import struct
from typing import Any, BinaryIO

__all__ = ["read_frame", "write_frame"]

_LENGTHS = struct.Struct("<II")
"""Bytes of the header and of what follows."""


def write_frame(file: BinaryIO, header: dict[str, Any], *parts: bytes | memoryview) -> None:
    """Write a header and bytes. Raises OSError if nobody reads them."""
    text = json.dumps(header).encode()
    file.write(_LENGTHS.pack(len(text), sum(len(part) for part in parts)))
    file.write(text)
    for part in parts:
        file.write(part)
    file.flush()


def read_frame(file: BinaryIO) -> tuple[dict[str, Any], bytes]:
    """Return the next header and bytes. Raises EOFError where none comes."""
    header, rest = _LENGTHS.unpack(_read(file, _LENGTHS.size))
    return json.loads(_read(file, header)), _read(file, rest)


def _read(file: BinaryIO, count: int) -> bytes:
    found = file.read(count)
    if len(found) < count:
        raise EOFError(f"{len(found)} of {count} bytes")
    return found
