"""Descriptions with numbers, as a page loads them once."""

from __future__ import annotations

import json
import struct
from typing import Any

__all__ = ["pack"]

_LENGTH = struct.Struct("<I")
_ALIGN = 4


def pack(described: Any, numbers: bytes | bytearray) -> bytes:
    """Return the length of the text (u32), JSON, spaces up to a multiple of 4, then the numbers."""
    text = json.dumps(described, separators=(",", ":")).encode()
    text += b" " * (-(len(text) + _LENGTH.size) % _ALIGN)
    return _LENGTH.pack(len(text)) + text + bytes(numbers)
