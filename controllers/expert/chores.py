"""What is to be done: which things belong where, and how each is taken. SI units, poses in the world."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from controllers.expert.grasps import Grasps
from schemas.vectors import Vector

__all__ = ["DROP", "SLACK", "Chore"]

SLACK = 6.0e-3
"""Between what is carried and what it passes over, m."""
DROP = 0.8e-3
"""From where a jaw lets go to where the thing comes to rest, m."""


class Chore(Protocol):
    """The things of one task, by index, and what is known of them from their poses alone.

    A task has two sides: 0, where things start, and 1, where they belong at first.
    """

    @property
    def things(self) -> tuple[str, ...]:
        """Names of what is carried."""
        ...

    @property
    def travel(self) -> float:
        """Height of a thing's middle at which it passes over everything, m."""
        ...

    @property
    def clear(self) -> float:
        """Height that the fingers of an empty hand pass over, m."""
        ...

    @property
    def meeting(self) -> Vector:
        """Where a thing's middle is when one hand gives it to the other, m."""
        ...

    @property
    def depth(self) -> float:
        """Height below which a thing has left the scene, m."""
        ...

    def side(self, thing: int, poses: Vector) -> int:
        """Return the side on which a thing is, given the poses (n, 4, 4) of all."""
        ...

    def middle_of(self, side: int) -> Vector:
        """Return the middle of a side, m, shape (3,)."""
        ...

    def is_done(self, thing: int, poses: Vector, side: int) -> bool:
        """Say whether a thing is where it belongs on a side."""
        ...

    def place(self, thing: int, poses: Vector, side: int) -> Vector:
        """Return where on a side the middle of a thing is to be when the jaw opens, m."""
        ...

    def rest(self, thing: int, poses: Vector, side: int) -> Vector:
        """Return where a thing that did not stand upright is put upright, from a hand that leans, m."""
        ...

    def above(self, place: Vector) -> float:
        """Return the height of a thing's middle, just over `place`, at which it is brought in line, m."""
        ...

    def grasps(self, thing: int, poses: Vector, reach: float, other: Vector | None) -> Iterator[Grasps]:
        """Yield how a thing can be taken by fingers as long as `reach`, m, given the poses (n, 4, 4) of all.

        `other`: the tip's pose (4, 4) of a hand as long that holds it, if one does. Those that come later are
        for where an arm reaches none of those before.
        """
        ...

    def room(self, points: Vector) -> Vector:
        """Return the least room of an instrument to what stands around, m, shape (n,), at best `ROOMY`.

        `points` in it, shape (n, points, 3), m, are those of controllers.expert.reach.
        """
        ...
