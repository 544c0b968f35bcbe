"""The RTPS messages of `devices.ros.dds.services`, little-endian only.

Message, submessages (DATA, DATA_FRAG, HEARTBEAT, HEARTBEAT_FRAG, ACKNACK, NACK_FRAG, GAP, INFO_DST) and
parameter lists. Source: OMG DDSI-RTPS 2.5, 8.3 and 9.4 (submessages), 9.6.2 and 9.6.3 (parameters). INFO_TS
is skipped; fragments are received and never sent, as responses fit into a datagram.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from schemas.errors import MessageError

__all__ = [
    "PL_CDR_LE",
    "AckNack",
    "Data",
    "DataFragments",
    "FromWriter",
    "Gap",
    "Heartbeat",
    "HeartbeatFragments",
    "Message",
    "Submessage",
    "encode_acknack",
    "encode_data",
    "encode_heartbeat",
    "encode_message",
    "encode_nack_fragments",
    "encode_parameters",
    "encode_sequence_number",
    "encode_string",
    "parse_message",
    "parse_parameters",
]

PL_CDR_LE = b"\x00\x03\x00\x00"
"""Encapsulation header of a parameter list, as in discovery data."""
_PID_SENTINEL = struct.pack("<HH", 1, 0)
_LITTLE_ENDIAN, _INLINE_QOS, _FINAL, _DATA_PRESENT, _KEY_PRESENT = 1, 2, 2, 4, 8
"""Flags of submessages: of all; DATA; HEARTBEAT and ACKNACK; DATA; DATA."""
_ACKNACK, _HEARTBEAT, _GAP, _INFO_DST, _DATA = 0x06, 0x07, 0x08, 0x0E, 0x15
_NACK_FRAG, _HEARTBEAT_FRAG, _DATA_FRAG = 0x12, 0x13, 0x16
_MOST_IN_SET = 256
"""Most numbers in a SequenceNumberSet or FragmentNumberSet."""


@dataclass(frozen=True, slots=True)
class Data:
    """DATA: a sample. `writer_id` and `reader_id` are EntityIds, 4 bytes, here and below."""

    writer_id: bytes
    reader_id: bytes
    sequence_number: int
    inline_qos: Mapping[int, bytes]
    """Parameters beside the payload, by id."""
    payload: bytes
    """Payload with encapsulation header; for a disposed instance the key, or nothing."""


@dataclass(frozen=True, slots=True)
class DataFragments:
    """DATA_FRAG: consecutive fragments of a sample."""

    writer_id: bytes
    reader_id: bytes
    sequence_number: int
    first: int
    """Number of the first fragment, from 1."""
    count: int
    fragment_size: int
    """Bytes of each fragment but the last of the sample."""
    sample_size: int
    """Bytes of the whole payload, with encapsulation header."""
    inline_qos: Mapping[int, bytes]
    content: bytes


@dataclass(frozen=True, slots=True)
class HeartbeatFragments:
    """HEARTBEAT_FRAG: the writer has the fragments of a sample up to `last`."""

    writer_id: bytes
    reader_id: bytes
    sequence_number: int
    last: int


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """HEARTBEAT: the samples of a writer, `first` to `last`."""

    writer_id: bytes
    reader_id: bytes
    first: int
    last: int
    is_final: bool
    """Whether a reader with all samples need not answer."""


@dataclass(frozen=True, slots=True)
class AckNack:
    """ACKNACK: a reader has all samples before `base`, and requests `missing`."""

    writer_id: bytes
    reader_id: bytes
    base: int
    missing: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Gap:
    """GAP: samples irrelevant to the reader, from `start` until before `base`, and `others`."""

    writer_id: bytes
    reader_id: bytes
    start: int
    base: int
    others: tuple[int, ...]


FromWriter: TypeAlias = Data | DataFragments | Heartbeat | HeartbeatFragments | Gap
"""Submessages from a matched writer."""
Submessage: TypeAlias = FromWriter | AckNack


@dataclass(frozen=True, slots=True)
class Message:
    """The submessages of a datagram for a participant."""

    guid_prefix: bytes
    """GUID prefix of the sending participant: 12 bytes, the first two for the vendor."""
    submessages: tuple[Submessage, ...]


def encode_message(source: bytes, destination: bytes, submessages: Iterable[bytes]) -> bytes:
    """Return a message with INFO_DST; `source` and `destination` are GUID prefixes, the latter 0 for all."""
    header = b"RTPS\x02\x03" + source[:2] + source
    return header + _encode_submessage(_INFO_DST, 0, destination) + b"".join(submessages)


def _encode_submessage(kind: int, flags: int, content: bytes) -> bytes:
    content += bytes(-len(content) % 4)
    return struct.pack("<BBH", kind, flags | _LITTLE_ENDIAN, len(content)) + content


def encode_sequence_number(value: int) -> bytes:
    """Return a SequenceNumber, 8 bytes."""
    return struct.pack("<iI", value >> 32, value & 0xFFFFFFFF)


def encode_data(
    writer_id: bytes,
    reader_id: bytes,
    sequence_number: int,
    payload: bytes,
    inline_qos: Mapping[int, bytes] | None = None,
) -> bytes:
    """Return a DATA submessage; without payload: inline QoS only, such as a disposal."""
    qos = encode_parameters(inline_qos) if inline_qos else b""
    flags = (_DATA_PRESENT if payload else 0) | (_INLINE_QOS if inline_qos else 0)
    head = struct.pack("<HH", 0, 16) + reader_id + writer_id + encode_sequence_number(sequence_number)
    return _encode_submessage(_DATA, flags, head + qos + payload)


def encode_heartbeat(writer_id: bytes, reader_id: bytes, first: int, last: int, count: int) -> bytes:
    """Return a HEARTBEAT submessage with a required ACKNACK."""
    numbers = encode_sequence_number(first) + encode_sequence_number(last)
    return _encode_submessage(_HEARTBEAT, 0, reader_id + writer_id + numbers + struct.pack("<I", count))


def encode_acknack(
    writer_id: bytes, reader_id: bytes, base: int, missing: Iterable[int], count: int
) -> bytes:
    """Return an ACKNACK submessage: has all before `base`, requests `missing` (within 256 of `base`)."""
    numbers = encode_sequence_number(base) + _number_set_bitmap(base, missing)
    return _encode_submessage(_ACKNACK, _FINAL, reader_id + writer_id + numbers + struct.pack("<I", count))


def encode_nack_fragments(
    writer_id: bytes, reader_id: bytes, sequence_number: int, missing: Sequence[int], count: int
) -> bytes:
    """Return a NACK_FRAG submessage: of a sample, the fragments `missing` (within 256 of the first)."""
    numbers = struct.pack("<I", missing[0]) + _number_set_bitmap(missing[0], missing)
    sample = encode_sequence_number(sequence_number)
    return _encode_submessage(
        _NACK_FRAG, 0, reader_id + writer_id + sample + numbers + struct.pack("<I", count)
    )


def _number_set_bitmap(base: int, members: Iterable[int]) -> bytes:
    """Return number of bits and bitmap of a set of numbers, without numbers beyond 256 from `base`."""
    offsets = [number - base for number in members if number - base < _MOST_IN_SET]
    bits = max(offsets, default=-1) + 1
    words = [0] * ((bits + 31) // 32)
    for offset in offsets:
        words[offset // 32] |= 1 << (31 - offset % 32)
    return struct.pack(f"<I{len(words)}I", bits, *words)


def encode_parameters(values: Mapping[int, bytes]) -> bytes:
    """Return a parameter list."""
    padded = {id_: value + bytes(-len(value) % 4) for id_, value in values.items()}
    encoded = b"".join(struct.pack("<HH", id_, len(value)) + value for id_, value in padded.items())
    return encoded + _PID_SENTINEL


def parse_parameters(encoded: bytes) -> tuple[dict[int, bytes], int]:
    """Return a parameter list, the first of each id, and the length in bytes.

    Raises MessageError for a list without sentinel.
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


def encode_string(value: str) -> bytes:
    """Return a string in the form of a parameter."""
    encoded = value.encode() + b"\0"
    return struct.pack("<I", len(encoded)) + encoded


def parse_message(datagram: bytes, own: bytes) -> Message:
    """Return the part of a datagram for the participant with the GUID prefix `own`.

    Raises MessageError if the datagram is no RTPS message, or big-endian.
    """
    if len(datagram) < 20 or datagram[:4] != b"RTPS":
        raise MessageError(f"{len(datagram)} bytes are no message of RTPS")
    try:
        return Message(datagram[8:20], tuple(_parse_submessages(datagram, own)))
    except (struct.error, IndexError) as error:
        raise MessageError(f"{len(datagram)} bytes are a truncated message of RTPS: {error}") from error


def _parse_submessages(datagram: bytes, own: bytes) -> Iterator[Submessage]:
    at, is_ours = 20, True
    while at + 4 <= len(datagram):
        kind, flags, length = struct.unpack_from("<BBH", datagram, at)
        if not flags & _LITTLE_ENDIAN:
            raise MessageError("big-endian messages of RTPS are not supported")
        content = datagram[at + 4 : at + 4 + length] if length else datagram[at + 4 :]
        at += 4 + len(content)
        if kind == _INFO_DST:
            is_ours = content[:12] in (own, bytes(12))
        elif is_ours and kind == _DATA:
            yield _data(content, flags)
        elif is_ours and kind == _DATA_FRAG:
            yield _data_fragments(content, flags)
        elif is_ours and kind == _HEARTBEAT_FRAG:
            (last,) = struct.unpack_from("<I", content, 16)
            yield HeartbeatFragments(content[4:8], content[:4], _sequence_number(content, 8), last)
        elif is_ours and kind == _HEARTBEAT:
            first, last = _sequence_number(content, 8), _sequence_number(content, 16)
            yield Heartbeat(content[4:8], content[:4], first, last, bool(flags & _FINAL))
        elif is_ours and kind == _ACKNACK:
            yield AckNack(content[4:8], content[:4], *_sequence_number_set(content, 8))
        elif is_ours and kind == _GAP:
            start = _sequence_number(content, 8)
            yield Gap(content[4:8], content[:4], start, *_sequence_number_set(content, 16))


def _data(content: bytes, flags: int) -> Data:
    at, inline_qos = _inline_qos(content, flags)
    payload = content[at:] if flags & (_DATA_PRESENT | _KEY_PRESENT) else b""
    return Data(content[8:12], content[4:8], _sequence_number(content, 12), inline_qos, payload)


def _data_fragments(content: bytes, flags: int) -> DataFragments:
    at, inline_qos = _inline_qos(content, flags)
    number = _sequence_number(content, 12)
    numbers = struct.unpack_from("<IHHI", content, 20)
    return DataFragments(content[8:12], content[4:8], number, *numbers, inline_qos, content[at:])


def _inline_qos(content: bytes, flags: int) -> tuple[int, dict[int, bytes]]:
    """Return the offset of the payload of a DATA or DATA_FRAG, and the inline QoS before the payload."""
    (to_qos,) = struct.unpack_from("<H", content, 2)
    at = 4 + to_qos
    if not flags & _INLINE_QOS:
        return at, {}
    inline_qos, length = parse_parameters(content[at:])
    return at + length, inline_qos


def _sequence_number(content: bytes, at: int) -> int:
    high, low = struct.unpack_from("<iI", content, at)
    return (high << 32) + low


def _sequence_number_set(content: bytes, at: int) -> tuple[int, tuple[int, ...]]:
    """Return base and numbers of a SequenceNumberSet."""
    base = _sequence_number(content, at)
    (bits,) = struct.unpack_from("<I", content, at + 8)
    bits = min(bits, _MOST_IN_SET)
    words = struct.unpack_from(f"<{(bits + 31) // 32}I", content, at + 12)
    return base, tuple(base + bit for bit in range(bits) if words[bit // 32] >> (31 - bit % 32) & 1)
