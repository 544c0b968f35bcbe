"""The first array of a message for a page, without decoding and checking the rest."""

from __future__ import annotations

import struct

from schemas.errors import MessageError

__all__ = ["first_sequence"]

_COUNT = struct.Struct("<I")
_LITTLE_ENDIAN = b"\0\1"
_STAMP = 4 + 8
"""The encapsulation of CDR, and the stamp of a header."""


def first_sequence(payload: bytes, width: int) -> bytes:
    """Return the first array of a message of a header, a word and arrays, as little-endian CDR.

    Such are pictures and the states of soft bodies: both go to pages many times a second. `width`: bytes of
    each element. Raises MessageError for any other message.
    """
    try:
        if payload[:2] != _LITTLE_ENDIAN:
            raise MessageError(f"{len(payload)} bytes are no little-endian CDR")
        at = _STAMP
        for _ in range(2):  # the frame of the header, and the word: each is followed by zeros up to 4 bytes
            at += _COUNT.size + _COUNT.unpack_from(payload, at)[0]
            at += -at % 4
        (count,) = _COUNT.unpack_from(payload, at)
    except struct.error as error:
        raise MessageError(f"{len(payload)} bytes are no such message: {error}") from error
    start, size = at + _COUNT.size, count * width
    if start + size > len(payload):
        raise MessageError(f"an array of {size} bytes at {start} in a message of {len(payload)}")
    return payload[start : start + size]
