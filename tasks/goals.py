"""Where the objects of a task begin and where they belong, and the counting of those that got there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hub.participant import Record, array, integer
from schemas.vectors import Vector
from tasks.events import Event

__all__ = ["Goals", "Legs"]


@dataclass(frozen=True)
class Goals:
    """The places of a task; without any, an object has no place where it belongs."""

    places: tuple[str, ...] = ()
    """Their names."""
    positions: Vector | None = None
    """Where an object is once it lies there, m, in the world, shape (places, 3)."""
    starts: tuple[frozenset[int], ...] = ()
    """Of each object: the places where it may begin, and has to go back to; none: it does not go back."""
    targets: tuple[frozenset[int], ...] = ()
    """Of each object: the places where it belongs."""
    hand_over: bool = False
    """On its way, each object has to be handed over."""


class LegsState(Record):
    """Progress of the transfers."""

    leg = integer()
    """From 0; even: to the targets, odd: back."""
    counted = array("objects")
    """1 for each object that has been placed in this leg."""
    handed = array("objects")
    """1 for each object that has been handed over since it was grasped."""
    total = integer()
    """Objects that were placed, in all legs."""


class Legs:
    """Counts the objects that are brought where they belong; once all are, they have to go back."""

    def __init__(self, goals: Goals, *, hand_over: bool) -> None:
        """Count what reaches its target; with `hand_over` only what was handed over on its way."""
        self.state = LegsState(objects=len(goals.targets))
        self._ways = (goals.targets, goals.starts or (frozenset[int](),) * len(goals.targets))
        self._hand_over = hand_over

    def take(self, event: Event) -> bool:
        """Take an event; return whether an object has been brought where it belongs by it."""
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
