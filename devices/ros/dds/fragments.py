"""Samples in fragments: samples larger than a datagram (OMG DDSI-RTPS 2.5, 8.4.14)."""

from __future__ import annotations

from collections.abc import Mapping

from devices.ros.dds.rtps import Data, DataFragments
from schemas.errors import MessageError

__all__ = ["MOST_BYTES", "PartialSample"]

MOST_BYTES = 4 * 2**20
"""Size of the largest assembled sample; commands have some hundred bytes, lists of markers more."""


class PartialSample:
    """An incomplete sample. Fragments are numbered from 1."""

    def __init__(self, part: DataFragments) -> None:
        """Begin with the first arrived part; raises MessageError for too large a sample."""
        if not 0 < part.fragment_size <= part.sample_size <= MOST_BYTES:
            raise MessageError(
                f"a sample of {part.sample_size} bytes in fragments of {part.fragment_size}; a sample has at"
                f" most {MOST_BYTES}, and is not smaller than a fragment"
            )
        self._size, self._fragment_size = part.sample_size, part.fragment_size
        self._content = bytearray(part.sample_size)
        self._missing = set(range(1, -(-part.sample_size // part.fragment_size) + 1))
        self._inline_qos: Mapping[int, bytes] = {}

    def add(self, part: DataFragments) -> None:
        """Add fragments; raises MessageError for fragments of another sample."""
        start = (part.first - 1) * self._fragment_size
        end = min(start + part.count * self._fragment_size, self._size)
        if (part.sample_size, part.fragment_size) != (self._size, self._fragment_size) or not (
            0 <= start < end <= start + len(part.content)
        ):
            raise MessageError(
                f"{part.count} fragments from {part.first} on, {len(part.content)} bytes, do not fit a sample"
                f" of {self._size} in fragments of {self._fragment_size}"
            )
        self._content[start:end] = part.content[: end - start]
        self._missing.difference_update(range(part.first, part.first + part.count))
        self._inline_qos = self._inline_qos or part.inline_qos

    def missing(self, last: int | None = None) -> list[int]:
        """Return the missing fragments, up to `last`."""
        return sorted(number for number in self._missing if last is None or number <= last)

    def whole(self, part: DataFragments) -> Data:
        """Return the sample, completed by the fragments `part`."""
        return Data(
            part.writer_id, part.reader_id, part.sequence_number, self._inline_qos, bytes(self._content)
        )
