"""The energy books of the bonds.

A book holds the work done by the motion side, the work received by the force side, and the difference: the
energy created or lost by the coupling.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from hub.planning.plan import Plan
from schemas.codec import encode_as
from schemas.lockstep import Ack
from schemas.plain_sum import plain_sum
from schemas.ros import Header, Time
from schemas.trocar_msgs import CouplingEnergy

__all__ = ["EnergyBooks"]


@dataclass
class _Book:
    """The attributes of a `CouplingEnergy`."""

    bond: str
    header: Header = field(default_factory=Header)
    motion_work_j: float = 0.0
    force_work_j: float = 0.0

    @property
    def residual_j(self) -> float:
        return self.force_work_j - self.motion_work_j


class EnergyBooks:
    """The books of all bonds of a session, kept from the acks."""

    def __init__(self, plan: Plan) -> None:
        self._books = [_Book(planned.bond.name) for planned in plan.bonds]
        self._rows: dict[str, list[tuple[_Book, str]]] = {}
        for book, bond in zip(self._books, (planned.bond for planned in plan.bonds), strict=True):
            self._rows.setdefault(bond.motion.participant, []).append((book, "motion_work_j"))
            self._rows.setdefault(bond.force.participant, []).append((book, "force_work_j"))

    def book_work(self, participant: str, ack: Ack) -> None:
        """Book the work (J since the start) in the last step of a participant's ack."""
        rows = self._rows.get(participant)
        if rows and len(ack.work_j) >= len(rows):
            for (book, side), work in zip(rows, ack.work_j[-len(rows) :], strict=True):
                setattr(book, side, work)

    @property
    def residual_j(self) -> float:
        """Work received by the force sides minus work done by the motion sides, summed over all bonds (J)."""
        return plain_sum(book.residual_j for book in self._books)

    def encode_books(self, time_ns: int) -> dict[str, bytes]:
        """Return the book of each bond, a `CouplingEnergy` in CDR."""
        header = Header(stamp=Time.from_ns(time_ns))
        for book in self._books:
            book.header = header
        return {book.bond: encode_as(CouplingEnergy, book) for book in self._books}
