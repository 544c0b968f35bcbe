"""The binary frames from server to page: little-endian, each a head and sections.

    head      4 bytes `TRCF`, u16 version, u16 number of sections, i64 simulated time (ns), u32 number of the
              frame, u32 zero
    section   u16 kind, u16 index, u32 bytes of content, content, zeros up to a multiple of 8

A page acknowledges a frame by the frame's number (u32). Numbers are in the frame of the world, metres.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hub.participant.view import tint_of
from schemas.errors import MessageError
from schemas.trocar_msgs import SurfaceChange, SurfaceFilm

__all__ = [
    "VERSION",
    "Section",
    "SectionKind",
    "change_content",
    "film_content",
    "frame",
    "node_content",
    "parse_acknowledgement",
    "pose_content",
    "sections",
]

MAGIC = b"TRCF"
VERSION = 3
_HEAD = struct.Struct("<4sHHqII")
_SECTION = struct.Struct("<HHI")
_ACK = _COUNT = struct.Struct("<I")
_ALIGN = 8


class SectionKind(IntEnum):
    """Content of a section; the index counts the page's objects of the same kind."""

    POSES = 1
    """Poses of the bodies of a scene: `pose_content`."""
    SURFACE = 2
    """u32 (f, 3): triangles of a soft surface at time 0, before the first nodes."""
    NODES = 3
    """The nodes of a soft surface: `node_content`."""
    PICTURE = 4
    """A compressed picture as published."""
    SAMPLE = 5
    """f64 (1 + size): time (s) and value of a numeric port."""
    ARROWS = 6
    """f32 (n, 6): point and force (N) of each arrow of a bond."""
    MARKERS = 7
    """All markers of a participant: `webconsole/markers.py`."""
    FELT = 8
    """f32: norm of the force (N) for the hand at a device."""
    CHANGE = 9
    """Difference of a soft surface from its triangles: `change_content`."""
    FILM = 10
    """Liquid on a soft surface: `film_content`."""
    SMOKE = 11
    """f32: smoke of a soft surface, g/s."""


class Section(NamedTuple):
    """A part of a frame."""

    kind: SectionKind
    place: int
    """Index of the section."""
    content: bytes


def pose_content(poses: NDArray[np.float32]) -> bytes:
    """Return positions, f32 (bodies, 3), and quaternions (x, y, z, w), i16 (bodies, 4), 32767 being 1.

    A part 1 m from the origin of the body is drawn 30 um aside at most. `poses`: shape (bodies, 7).
    """
    turns: NDArray[np.int16] = np.rint(32767.0 * poses[:, 3:]).astype("<i2")
    return poses[:, :3].astype("<f4").tobytes() + turns.tobytes()


def node_content(nodes: NDArray[np.float32]) -> bytes:
    """Return least node and step, f32 (3,) each, and the steps from the least node to each node, u16 (3, n).

    In an organ of 200 mm a node is 1.5 um aside at most. `nodes`: x, y, z of node after node. Raises
    MessageError if the nodes are not whole or not finite.
    """
    if nodes.size % 3:
        raise MessageError(f"{nodes.size} numbers are no nodes of three")
    columns = np.ascontiguousarray(nodes.reshape(-1, 3).T)
    low, high = columns.min(axis=1, keepdims=True), columns.max(axis=1, keepdims=True)
    if not np.isfinite(high - low).all():
        raise MessageError("a node is not finite")
    step = np.maximum((high - low) / np.float32(65535.0), np.float32(1e-12))
    steps: NDArray[np.uint16] = np.rint((columns - low) / step).astype("<u2")
    return low.astype("<f4").tobytes() + step.astype("<f4").tobytes() + steps.tobytes()


def change_content(change: SurfaceChange) -> bytes:
    """Return the content of a change; empty without changed faces.

    It is their number k, u32, their slots, u32 (k,), the faces as node indices, i32 (k, 3), the first node at
    the resting place of each appended node, u32 (m,), and the kinds of the faces, u8 (k,). A face of three
    times -1 is gone.
    """
    if not change.slots.size:
        return b""
    slots, faces = change.slots.astype("<u4"), change.faces.astype("<i4")
    numbers = _COUNT.pack(len(slots)) + slots.tobytes() + faces.tobytes()
    return numbers + change.origins.astype("<u4").tobytes() + change.kinds.tobytes()


def film_content(film: SurfaceFilm) -> bytes:
    """Return the content of a film.

    It is deep colour and depths of red, green and blue, f32 (6,), wet nodes, u32 (k,), and the thickness at
    each, u8 (k,), in steps of 10 um.
    """
    tint = tint_of(film.liquid)
    head = np.array([*tint.deep, *tint.depth_m], "<f4").tobytes()
    return head + film.nodes.astype("<u4").tobytes() + film.thickness.tobytes()


def frame(number: int, time_ns: int, parts: Sequence[Section]) -> bytes:
    """Return the frame with this number, of this simulated time."""
    pieces = [_HEAD.pack(MAGIC, VERSION, len(parts), time_ns, number, 0)]
    for kind, index, content in parts:
        pieces += _SECTION.pack(kind, index, len(content)), content, b"\0" * (-len(content) % _ALIGN)
    return b"".join(pieces)


def sections(data: bytes) -> tuple[int, int, list[Section]]:
    """Return number, simulated time (ns) and sections of a frame; raises MessageError if it is no frame."""
    try:
        magic, version, count, time_ns, number, _ = _HEAD.unpack_from(data)
        if (magic, version) != (MAGIC, VERSION):
            raise MessageError(
                f"a frame begins with {magic!r}, version {version}; expected {MAGIC!r}, {VERSION}"
            )
        at, found = _HEAD.size, list[Section]()
        for _ in range(count):
            kind, index, size = _SECTION.unpack_from(data, at)
            at += _SECTION.size
            if at + size > len(data):
                raise MessageError(
                    f"a section of {size} bytes at {at} passes the end of a frame of {len(data)}"
                )
            found.append(Section(SectionKind(kind), index, data[at : at + size]))
            at += size + -size % _ALIGN
    except (struct.error, ValueError) as error:
        raise MessageError(f"not a frame: {error}") from error
    return number, time_ns, found


def parse_acknowledgement(data: bytes) -> int:
    """Return the number of the frame acknowledged by a page; raises MessageError for other data."""
    if len(data) != _ACK.size:
        raise MessageError(f"an acknowledgement of {len(data)} bytes, expected {_ACK.size}")
    return _ACK.unpack(data)[0]
