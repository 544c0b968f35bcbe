"""The attachments of messages on Zenoh.

Values and samples have run, step or sequence number, and time of sending; acks have a signature.
"""

from __future__ import annotations

import struct
from hashlib import blake2b
from time import monotonic_ns
from typing import NamedTuple

import zenoh

from schemas.errors import MessageError

__all__ = ["Stamp", "Tag", "signature"]

_TAG = struct.Struct("<QIqqHHq")
_STAMP = struct.Struct("<QQq")


class Tag:
    """The attachment of every value.

    Run, epoch, step of computation, time of validity, index and count of an event batch, and time of
    publication (by the monotonic clock of the publishing host).
    """

    __slots__ = ("count", "epoch", "index", "run", "sent_ns", "step", "time_ns")
    SIZE = _TAG.size

    def __init__(
        self, run: int, epoch: int, step: int, time_ns: int, index: int, count: int, sent_ns: int
    ) -> None:
        self.run, self.epoch, self.step, self.time_ns, self.index, self.count, self.sent_ns = (
            run,
            epoch,
            step,
            time_ns,
            index,
            count,
            sent_ns,
        )

    @staticmethod
    def pack(run: int, epoch: int, step: int, time_ns: int, index: int = 0, count: int = 1) -> bytes:
        """Return the bytes of the tag of a value published now."""
        return _TAG.pack(run, epoch, step, time_ns, index, count, monotonic_ns())

    @classmethod
    def of(cls, sample: zenoh.Sample) -> Tag:
        """Return the tag of `sample`; raises MessageError if there is none."""
        return cls.unpack(b"" if sample.attachment is None else sample.attachment.to_bytes())

    @classmethod
    def unpack(cls, raw: bytes) -> Tag:
        """Return the tag in `raw`; raises MessageError for another length."""
        if len(raw) != Tag.SIZE:
            raise MessageError(f"attachment of {len(raw)} bytes, a value's tag has {Tag.SIZE}")
        return cls(*_TAG.unpack(raw))


class Stamp(NamedTuple):
    """The attachment of every sample of a device."""

    admission: int
    """Number of the host's admission: a device joining again counts samples from 1 again."""
    sequence: int
    """Number of the sample among the samples of a port."""
    sent_ns: int
    """Time at which the device returned the sample, by the monotonic clock of the host, or simulated time."""

    def pack(self) -> bytes:
        """Return the bytes of a stamp."""
        return _STAMP.pack(*self)

    @classmethod
    def of(cls, sample: zenoh.Sample) -> Stamp:
        """Return the stamp of `sample`; raises MessageError if there is none."""
        raw = b"" if sample.attachment is None else sample.attachment.to_bytes()
        if len(raw) != _STAMP.size:
            raise MessageError(f"attachment of {len(raw)} bytes, a device's sample has {_STAMP.size}")
        return cls(*_STAMP.unpack(raw))


def signature(payload: bytes, key: bytes) -> bytes:
    """Return the attachment of an ack; only a host with the `key` from the hub can make the attachment."""
    return blake2b(payload, digest_size=8, key=key).digest()
