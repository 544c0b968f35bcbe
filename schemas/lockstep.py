"""Grants and acks as the step loop uses them, to CDR and back: needed in every step.

Values are not validated again (the tests compare the bytes with `GrantMessage` and `AckMessage`). Acks
without an error are unpacked here, at a tenth of the cost of `decode`; acks with an error go through
`decode`, and so does a grant with samples.
"""

from __future__ import annotations

import struct
from collections.abc import Hashable, Sequence
from functools import cache
from math import isfinite
from typing import Any, NamedTuple

from schemas.codec import decode, encode_as
from schemas.errors import MessageError
from schemas.message import Bytes
from schemas.trocar_msgs import AckMessage, GrantMessage, InletSample

__all__ = ["Ack", "Entering", "Grant", "pack_ack", "pack_grant", "unpack_ack", "unpack_grant"]

_CDR = b"\x00\x01\x00\x00"
_GRANT = struct.Struct("<4sQI4xqqqI")


class Entering(NamedTuple):
    """An `InletSample` of the step loop: at a fifth of the cost of a message."""

    participant: str
    port: str
    stale: bool
    payload: Bytes
    age_ns: int
    decoded: tuple[Hashable, Any] | None = None
    """Layout of the port and value of the payload, if this process has decoded it."""


class Grant(NamedTuple):
    """A `GrantMessage` of the step loop: steps `step` to `end` (exclusive)."""

    run: int
    epoch: int
    step: int
    start_ns: int
    horizon_ns: int
    inlets: Sequence[InletSample | Entering] = ()


class Ack(NamedTuple):
    """An `AckMessage` of the step loop.

    There is a hash and a compute time per step, and the works of all bonds per step.
    """

    run: int
    epoch: int
    step: int
    state_hash: Sequence[int]
    compute_ns: Sequence[int]
    work_j: Sequence[float]
    error: str = ""


def pack_grant(grant: Grant) -> bytes:
    """Return a `GrantMessage` in CDR."""
    return encode_as(GrantMessage, grant)


def unpack_grant(payload: bytes) -> Grant:
    """Return the `GrantMessage` in `payload`; raises MessageError if there is none."""
    if len(payload) == _GRANT.size:
        cdr, *numbers, count = _GRANT.unpack(payload)
        if cdr == _CDR and count == 0:
            return Grant(*numbers)
    grant = decode(GrantMessage, payload)
    return Grant(grant.run, grant.epoch, grant.step, grant.start_ns, grant.horizon_ns, grant.inlets)


@cache
def _ack(steps: int, works: int) -> struct.Struct:
    """Return the layout of an ack without an error.

    The elements of a sequence are aligned to 8 bytes; an empty sequence has none.
    """
    align = "4x" if steps else ""
    return struct.Struct(f"<4sQI4xqI{align}{steps}QI{align}{steps}QI{'4x' if works else ''}{works}dIB")


def pack_ack(ack: Ack) -> bytes:
    """Return an `AckMessage` in CDR."""
    return encode_as(AckMessage, ack)


def unpack_ack(payload: bytes, steps: int, works: int) -> Ack:
    """Return the `AckMessage` in `payload`, with `steps` hashes and `works` works.

    Raises MessageError for another message, wrong lengths or a work that is not finite. An ack with an
    error may have any lengths.
    """
    layout = _ack(steps, works)
    if len(payload) == layout.size:
        cdr, run, epoch, step, n, *rest = layout.unpack(payload)
        hashes, times, work = (
            rest[:steps],
            rest[steps + 1 : 2 * steps + 1],
            rest[2 * steps + 2 : 2 * steps + 2 + works],
        )
        if (
            cdr == _CDR
            and (n, rest[steps], rest[2 * steps + 1], rest[-2], rest[-1]) == (steps, steps, works, 1, 0)
            and all(map(isfinite, work))
        ):
            return Ack(run, epoch, step, hashes, times, work)
    ack = decode(AckMessage, payload)
    if not ack.error and (ack.state_hash.size, ack.compute_ns.size, ack.work_j.size) != (steps, steps, works):
        raise MessageError(
            f"ack of {ack.state_hash.size} steps and {ack.work_j.size} works, expected {steps} and {works}"
        )
    return Ack(
        ack.run,
        ack.epoch,
        ack.step,
        ack.state_hash.tolist(),
        ack.compute_ns.tolist(),
        ack.work_j.tolist(),
        ack.error,
    )
