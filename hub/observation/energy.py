"""The energy books of the bonds.

A book holds the work that the motion side did, the work that the force side received, and their difference:
the energy that the coupling created or lost.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from hub.planning.plan import Plan, PlannedBond
from schemas.codec import encode
from schemas.lockstep import Ack
from schemas.ros import Header
from schemas.trocar_msgs import CouplingEnergy

__all__ = ["EnergyBooks"]


_STAMP, _WORKS = struct.Struct("<iI"), struct.Struct("<ddd")
"""What changes in the CDR of a `CouplingEnergy`: its first field and its last ones."""
_CDR_HEADER_BYTES = 4


@dataclass
class _Book:
    bond: str
    template: bytes
    """A book in CDR."""
    motion_j: float = 0.0
    force_j: float = 0.0

    @property
    def residual_j(self) -> float:
        return self.force_j - self.motion_j


class EnergyBooks:
    """The books of all bonds of a session, kept from the acks."""

    def __init__(self, plan: Plan) -> None:
        self._books = [_book(planned) for planned in plan.bonds]
        self._rows: dict[str, list[tuple[_Book, str]]] = {}
        for book, bond in zip(self._books, (planned.bond for planned in plan.bonds), strict=True):
            self._rows.setdefault(bond.motion.participant, []).append((book, "motion_j"))
            self._rows.setdefault(bond.force.participant, []).append((book, "force_j"))

    def take(self, participant: str, ack: Ack) -> None:
        """Book the work (J since the start) that a participant states in the last step of its ack."""
        rows = self._rows.get(participant)
        if rows and len(ack.work_j) >= len(rows):
            for (book, side), work in zip(rows, ack.work_j[-len(rows) :], strict=True):
                setattr(book, side, work)

    @property
    def residual_j(self) -> float:
        """Sum over all bonds of the work received by the force side minus that of the motion side (J)."""
        return sum(book.residual_j for book in self._books)

    def encoded(self, time_ns: int) -> dict[str, bytes]:
        """Return the book of each bond, a `CouplingEnergy` in CDR."""
        stamp = divmod(time_ns, 10**9)
        return {book.bond: _encoded(book, stamp) for book in self._books}


def _book(planned: PlannedBond) -> _Book:
    name = planned.bond.name
    empty = CouplingEnergy(header=Header(), bond=name, motion_work_j=0.0, force_work_j=0.0, residual_j=0.0)
    return _Book(name, encode(empty))


def _encoded(book: _Book, stamp: tuple[int, int]) -> bytes:
    encoded = bytearray(book.template)
    _STAMP.pack_into(encoded, _CDR_HEADER_BYTES, *stamp)
    _WORKS.pack_into(encoded, len(encoded) - _WORKS.size, book.motion_j, book.force_j, book.residual_j)
    return bytes(encoded)
