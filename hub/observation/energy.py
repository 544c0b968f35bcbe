"""The energy books of the bonds.

A book holds the work that the motion side did, the work that the force side received, and their difference:
the energy that the coupling created or lost.
"""

from __future__ import annotations

from dataclasses import dataclass

from hub.planning.plan import Plan, PlannedBond
from schemas.lockstep import Ack
from schemas.ros import Header, Time
from schemas.trocar_msgs import CouplingEnergy

__all__ = ["EnergyBooks"]


@dataclass
class _Book:
    planned: PlannedBond
    motion_j: float = 0.0
    force_j: float = 0.0


class EnergyBooks:
    """The books of all bonds of a session, kept from the acks."""

    def __init__(self, plan: Plan) -> None:
        self._books = [_Book(planned) for planned in plan.bonds]
        self._rows: dict[str, list[tuple[_Book, str]]] = {}
        for book in self._books:
            bond = book.planned.bond
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
        return sum(book.force_j - book.motion_j for book in self._books)

    def messages(self, time_ns: int) -> list[CouplingEnergy]:
        """Return the state of every book."""
        header = Header(stamp=Time.from_ns(time_ns))
        return [
            CouplingEnergy(
                header=header,
                bond=b.planned.bond.name,
                motion_work_j=b.motion_j,
                force_work_j=b.force_j,
                residual_j=b.force_j - b.motion_j,
            )
            for b in self._books
        ]
