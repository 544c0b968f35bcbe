"""The part of DDS's wire protocol that `dds_calls` speaks: messages, submessages and parameter lists,
little-endian.

Source: OMG DDSI-RTPS 2.5, 8.3 and 9.4 (submessages), 9.6.2 and 9.6.3 (parameters); the identity of a request
is a parameter of DDS-RPC 1.0, 7.8.2.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TypeAlias

from schemas.errors import MessageError

__all__ = [
    "PL_CDR_LE",
    "Acknack",
    "Data",
    "Gap",
    "Heartbeat",
    "Received",
    "acknack",
    "data",
    "heartbeat",
    "message",
    "parameters",
    "read_parameters",
    "received",
    "sequence_number",
    "text",
]

PL_CDR_LE = b"\x00\x03\x00\x00"
_SENTINEL = struct.pack("<HH", 1, 0)
_LITTLE, _INLINE_QOS, _FINAL, _PAYLOAD, _KEY = 1, 2, 2, 4, 8
_ACKNACK, _HEARTBEAT, _GAP, _INFO_DESTINATION, _DATA = 0x06, 0x07, 0x08, 0x0E, 0x15
_WINDOW = 256
"""Numbers in a set."""


@dataclass(frozen=True, slots=True)
class Data:
    """A sample; `writer` and `reader` are ids of 4 bytes, here and below."""

    writer: bytes
    reader: bytes
    number: int
    qos: Mapping[int, bytes]
    """Parameters beside it."""
    payload: bytes
    """With its encapsulation header; if it only says that something is gone, the key of that or nothing."""


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """What a writer has: samples `first` to `last`."""

    writer: bytes
    reader: bytes
    first: int
    last: int
    is_final: bool
    """Nobody has to answer who has all."""


@dataclass(frozen=True, slots=True)
class Acknack:
    """What a reader has: all before `base`; and what it asks for."""

    writer: bytes
    reader: bytes
    base: int
    missing: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Gap:
    """Samples that a reader will never get: from `start` until before `base`, and `others`."""

    writer: bytes
    reader: bytes
    start: int
    base: int
    others: tuple[int, ...]


Submessage: TypeAlias = Data | Heartbeat | Acknack | Gap


@dataclass(frozen=True, slots=True)
class Received:
    """A message for us."""

    source: bytes
    """GUID prefix of its sender, 12 bytes, of which the first two are its vendor."""
    submessages: tuple[Submessage, ...]


def message(source: bytes, destination: bytes, submessages: Iterable[bytes]) -> bytes:
    """Return a message from one participant to another, given by their GUID prefixes."""
    head = b"RTPS\x02\x03" + source[:2] + source
    return head + _submessage(_INFO_DESTINATION, 0, destination) + b"".join(submessages)


def _submessage(kind: int, flags: int, content: bytes) -> bytes:
    content += bytes(-len(content) % 4)
    return struct.pack("<BBH", kind, flags | _LITTLE, len(content)) + content


def sequence_number(value: int) -> bytes:
    """Return a sequence number as it goes over the wire."""
    return struct.pack("<iI", value >> 32, value & 0xFFFFFFFF)


def data(
    writer: bytes, reader: bytes, number: int, payload: bytes, qos: Mapping[int, bytes] | None = None
) -> bytes:
    """Return a DATA submessage; `qos`: parameters beside the payload. Without one it says only what they say."""
    beside = parameters(qos) if qos else b""
    flags = (_PAYLOAD if payload else 0) | (_INLINE_QOS if qos else 0)
    return _submessage(
        _DATA, flags, struct.pack("<HH", 0, 16) + reader + writer + sequence_number(number) + beside + payload
    )


def heartbeat(writer: bytes, reader: bytes, first: int, last: int, count: int) -> bytes:
    """Return a HEARTBEAT submessage that wants an answer."""
    return _submessage(
        _HEARTBEAT,
        0,
        reader + writer + sequence_number(first) + sequence_number(last) + struct.pack("<I", count),
    )


def acknack(writer: bytes, reader: bytes, base: int, missing: Iterable[int], count: int) -> bytes:
    """Return an ACKNACK submessage: all before `base` is there, `missing` (within 256) is asked for."""
    offsets = [number - base for number in missing if number - base < _WINDOW]
    bits = max(offsets, default=-1) + 1
    words = [0] * ((bits + 31) // 32)
    for offset in offsets:
        words[offset // 32] |= 1 << (31 - offset % 32)
    numbers = sequence_number(base) + struct.pack(f"<I{len(words)}I", bits, *words)
    return _submessage(_ACKNACK, _FINAL, reader + writer + numbers + struct.pack("<I", count))


def parameters(values: Mapping[int, bytes]) -> bytes:
    """Return a parameter list."""
    padded = {id_: value + bytes(-len(value) % 4) for id_, value in values.items()}
    return b"".join(struct.pack("<HH", id_, len(value)) + value for id_, value in padded.items()) + _SENTINEL


def read_parameters(encoded: bytes) -> tuple[dict[int, bytes], int]:
    """Return a parameter list, the first of each kind, and how many bytes it has.

    Raises MessageError if it has no end.
    """
    found: dict[int, bytes] = {}
    at = 0
    while at + 4 <= len(encoded):
        id_, length = struct.unpack_from("<HH", encoded, at)
        at += 4
        if id_ == 1:
            return found, at
        found.setdefault(id_, encoded[at : at + length])
        at += length
    raise MessageError(f"a parameter list of {len(encoded)} bytes has no end")


def text(value: str) -> bytes:
    """Return a string as a parameter has it."""
    encoded = value.encode() + b"\0"
    return struct.pack("<I", len(encoded)) + encoded


def received(datagram: bytes, own: bytes) -> Received:
    """Return what a datagram has for the participant with the GUID prefix `own`.

    Raises MessageError if it is no message, or one in big-endian.
    """
    if len(datagram) < 20 or datagram[:4] != b"RTPS":
        raise MessageError(f"{len(datagram)} bytes are no message of RTPS")
    try:
        return Received(datagram[8:20], tuple(_submessages(datagram, own)))
    except (struct.error, IndexError) as error:
        raise MessageError(f"{len(datagram)} bytes are a torn message of RTPS: {error}") from error


def _submessages(datagram: bytes, own: bytes) -> Iterator[Submessage]:
    at, is_ours = 20, True
    while at + 4 <= len(datagram):
        kind, flags, length = struct.unpack_from("<BBH", datagram, at)
        if not flags & _LITTLE:
            raise MessageError("a message of RTPS in big-endian is not read")
        content = datagram[at + 4 : at + 4 + length] if length else datagram[at + 4 :]
        at += 4 + len(content)
        if kind == _INFO_DESTINATION:
            is_ours = content[:12] in (own, bytes(12))
        elif is_ours and kind == _DATA:
            yield _read_data(content, flags)
        elif is_ours and kind == _HEARTBEAT:
            yield Heartbeat(
                content[4:8],
                content[:4],
                _read_number(content, 8),
                _read_number(content, 16),
                bool(flags & _FINAL),
            )
        elif is_ours and kind == _ACKNACK:
            yield Acknack(content[4:8], content[:4], *_read_set(content, 8))
        elif is_ours and kind == _GAP:
            yield Gap(content[4:8], content[:4], _read_number(content, 8), *_read_set(content, 16))


def _read_data(content: bytes, flags: int) -> Data:
    (to_qos,) = struct.unpack_from("<H", content, 2)
    at, qos = 4 + to_qos, dict[int, bytes]()
    if flags & _INLINE_QOS:
        qos, length = read_parameters(content[at:])
        at += length
    return Data(
        content[8:12],
        content[4:8],
        _read_number(content, 12),
        qos,
        content[at:] if flags & (_PAYLOAD | _KEY) else b"",
    )


def _read_number(content: bytes, at: int) -> int:
    high, low = struct.unpack_from("<iI", content, at)
    return (high << 32) + low


def _read_set(content: bytes, at: int) -> tuple[int, tuple[int, ...]]:
    """Return the base of a set of numbers, and the numbers."""
    base = _read_number(content, at)
    (bits,) = struct.unpack_from("<I", content, at + 8)
    bits = min(bits, _WINDOW)
    words = struct.unpack_from(f"<{(bits + 31) // 32}I", content, at + 12)
    return base, tuple(base + bit for bit in range(bits) if words[bit // 32] >> (31 - bit % 32) & 1)
