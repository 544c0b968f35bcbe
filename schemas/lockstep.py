"""Grants without inlet samples, and acks without an error, straight to CDR and back: what every step needs.

The layout is that of `Grant` and `Ack` in `schemas.trocar_msgs` (the tests hold it against `schemas.codec`);
whatever is not of this simple form goes through the codec. Packing and unpacking an ack takes 1 us each this
way, 11 us through the models (`bench/lockstep.py`).
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import cache
from math import isfinite
from typing import NamedTuple

from schemas.codec import decode, encode
from schemas.errors import MessageError
from schemas.trocar_msgs import Ack, Grant, InletSample

__all__ = ["Permission", "Report", "pack_permission", "pack_report", "unpack_permission", "unpack_report"]

_CDR = b"\x00\x01\x00\x00"
_GRANT = struct.Struct("<4sQI4xqqqI")


class Permission(NamedTuple):
    """A `Grant` as the step loop uses it: steps `step` to `end` (exclusive)."""

    run: int
    epoch: int
    step: int
    start_ns: int
    horizon_ns: int
    inlets: Sequence[InletSample] = ()


class Report(NamedTuple):
    """An `Ack` as the step loop uses it: one hash and one compute time per step, the works of all bonds per
    step.
    """

    run: int
    epoch: int
    step: int
    state_hash: Sequence[int]
    compute_ns: Sequence[int]
    work_j: Sequence[float]
    error: str = ""


def pack_permission(grant: Permission) -> bytes:
    """Return a `Grant` in CDR."""
    if grant.inlets:
        return encode(Grant.model_construct(**grant._asdict()))
    return _GRANT.pack(_CDR, *grant[:5], 0)


def unpack_permission(payload: bytes) -> Permission:
    """Return the `Grant` in `payload`; raises MessageError if there is none."""
    if len(payload) == _GRANT.size:
        cdr, *numbers, count = _GRANT.unpack(payload)
        if cdr == _CDR and count == 0:
            return Permission(*numbers)
    grant = decode(Grant, payload)
    return Permission(grant.run, grant.epoch, grant.step, grant.start_ns, grant.horizon_ns, grant.inlets)


@cache
def _ack(steps: int, works: int) -> struct.Struct:
    """Return the layout of an ack without an error: the elements of a sequence are aligned to 8 bytes, an
    empty one has none.
    """
    align = "4x" if steps else ""
    return struct.Struct(f"<4sQI4xqI{align}{steps}QI{align}{steps}QI{'4x' if works else ''}{works}dIB")


def pack_report(report: Report) -> bytes:
    """Return an `Ack` in CDR."""
    if report.error:
        return encode(Ack.model_validate(report._asdict()))
    steps, works = len(report.state_hash), len(report.work_j)
    head = report[:3]
    return _ack(steps, works).pack(
        _CDR, *head, steps, *report.state_hash, steps, *report.compute_ns, works, *report.work_j, 1, 0
    )


def unpack_report(payload: bytes, steps: int, works: int) -> Report:
    """Return the `Ack` in `payload`, of which `steps` hashes and `works` works are expected.

    Raises MessageError if it is none, has other lengths or a work that is not finite. An ack with an error
    may have any lengths.
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
            return Report(run, epoch, step, hashes, times, work)
    ack = decode(Ack, payload)
    if not ack.error and (ack.state_hash.size, ack.compute_ns.size, ack.work_j.size) != (steps, steps, works):
        raise MessageError(
            f"ack of {ack.state_hash.size} steps and {ack.work_j.size} works, expected {steps} and {works}"
        )
    return Report(
        ack.run,
        ack.epoch,
        ack.step,
        ack.state_hash.tolist(),
        ack.compute_ns.tolist(),
        ack.work_j.tolist(),
        ack.error,
    )
