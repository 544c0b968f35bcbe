"""Start and target places of the objects of a task, and the count of objects at their targets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hub.participant import Record, array, integer
from schemas.vectors import Vector
from tasks.events import Event

__all__ = ["Goals", "Legs"]


@dataclass(frozen=True)
class Goals:
    """The places of a task; without places, objects have no targets."""

    places: tuple[str, ...] = ()
    """Their names."""
    positions: Vector | None = None
    """Position of an object at each place, m, in the world, shape (places, 3)."""
    starts: tuple[frozenset[int], ...] = ()
    """Start places of each object, and targets of the way back; empty: no way back."""
    targets: tuple[frozenset[int], ...] = ()
    """Target places of each object."""
    hand_over: bool = False
    """Whether each object must be handed over on the way."""


class LegsState(Record):
    """Progress of the transfers."""

    leg = integer()
    """Number of the leg, from 0; even: to the targets, odd: back."""
    counted = array("objects")
    """1 for each object placed in this leg."""
    handed = array("objects")
    """1 for each object handed over since its grasp."""
    total = integer()
    """Number of placed objects, in all legs."""


class Legs:
    """Counts the objects brought to their targets; after the last object all have to go back."""

    def __init__(self, goals: Goals, *, hand_over: bool) -> None:
        """`hand_over`: count only objects handed over on the way."""
        self.state = LegsState(objects=len(goals.targets))
        self._ways = (goals.targets, goals.starts or (frozenset[int](),) * len(goals.targets))
        self._hand_over = hand_over

    def count(self, event: Event) -> bool:
        """Observe an event; return whether the event brings an object to its target."""
        now, thing = self.state, event.thing
        if event.kind in ("grasped", "handed over"):
            now.handed[thing] = float(event.kind == "handed over")
        if event.kind != "placed" or event.place not in self._ways[now.leg % 2][thing]:
            return False
        if now.counted[thing] or (self._hand_over and not now.handed[thing]):
            return False
        now.counted[thing], now.total = 1.0, now.total + 1
        if np.all(now.counted):
            now.leg, now.counted[:] = now.leg + 1, 0.0
        return True
