"""A chore: the targets and grasps of the objects of a task. SI units, poses in the world."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from controllers.expert.grasps import Grasps
from schemas.vectors import Vector

__all__ = ["DROP", "SLACK", "Chore"]

SLACK = 6.0e-3
"""Clearance between a carried object and obstacles below, m."""
DROP = 0.8e-3
"""Height of the fall of an object at its release, m."""


class Chore(Protocol):
    """The objects of one task, by index, with targets and grasps from their poses alone.

    A task has two sides: objects start on side 0, and their first targets are on side 1.
    """

    @property
    def objects(self) -> tuple[str, ...]:
        """Names of the objects."""
        ...

    @property
    def travel(self) -> float:
        """Height of a carried object's middle, above all obstacles, m."""
        ...

    @property
    def clear(self) -> float:
        """Height of the obstacles below the fingers of an empty hand, m."""
        ...

    @property
    def meeting(self) -> Vector:
        """Middle of an object in a hand-over, m."""
        ...

    @property
    def depth(self) -> float:
        """Height of the lowest object still in the scene, m."""
        ...

    def side(self, index: int, poses: Vector) -> int:
        """Return the side of an object, given the poses (n, 4, 4) of all objects."""
        ...

    def middle_of(self, side: int) -> Vector:
        """Return the middle of a side, m, shape (3,)."""
        ...

    def is_done(self, index: int, poses: Vector, side: int) -> bool:
        """Return whether an object is at its target on a side."""
        ...

    def place(self, index: int, poses: Vector, side: int) -> Vector:
        """Return the target of the object's middle on a side at the release, m."""
        ...

    def rest(self, index: int, poses: Vector, side: int) -> Vector:
        """Return the place for putting a fallen object upright with tilted fingers, m."""
        ...

    def above(self, place: Vector) -> float:
        """Return the height of an object's middle for the alignment over `place`, m."""
        ...

    def grasps(self, index: int, poses: Vector, reach: float, other: Vector | None) -> Iterator[Grasps]:
        """Yield grasps of an object, the preferred grasps first.

        `reach`: length of the fingers, m. `poses`: poses of all objects, (n, 4, 4). `other`: tip pose (4, 4)
        of the hand now holding the object.
        """
        ...

    def room(self, points: Vector) -> Vector:
        """Return the least clearance of an instrument from obstacles, m, shape (n,), at most `AMPLE_ROOM`.

        `points`: points of the instrument, shape (n, points, 3), m (see controllers.expert.reach).
        """
        ...
