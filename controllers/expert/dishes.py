"""Pieces, each of which belongs in a dish. SI units, poses in the world."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import cos, pi, sin

import numpy as np

from controllers.expert.chores import DROP, SLACK
from controllers.expert.grasps import ROOMY, Grasps, of_piece
from robots.training.dishes import DISH, PIECE
from robots.training.fixtures import DishParams
from schemas.vectors import Vector

__all__ = ["PickAndPlace"]

_SLOT = 11.5e-3
"""Of the places in a dish from its middle, m."""
_GONE = 0.05
"""Below the dishes, m: what is so low has fallen off the table."""


class PickAndPlace:
    """Pieces, each of which belongs in a dish; they go one way, to side 1."""

    def __init__(self, goals: Mapping[str, str], dishes: Mapping[str, DishParams]) -> None:
        """Take which dish each piece belongs in, and where the dishes are."""
        self.things = tuple(goals)
        self._centres = [np.array(dishes[dish].position) for dish in goals.values()]
        mates = list(goals.values())
        self._slots = [
            2.0 * pi * mates[:i].count(dish) / max(3, mates.count(dish)) for i, dish in enumerate(mates)
        ]
        floor = max(centre[2] for centre in self._centres)
        self.clear = float(floor + DISH.height + SLACK)
        self.travel = self.clear + PIECE.size[2] / 2.0
        self.depth = float(min(centre[2] for centre in self._centres)) - _GONE
        self.meeting = np.mean(self._centres, axis=0)
        self.meeting[2] = self.travel

    def side(self, thing: int, poses: Vector) -> int:
        """Return 1 inside its dish, else 0."""
        return int(self.is_done(thing, poses, 1))

    def middle_of(self, side: int) -> Vector:  # noqa: ARG002
        """Return the middle of all dishes."""
        return self.meeting

    def is_done(self, thing: int, poses: Vector, side: int) -> bool:  # noqa: ARG002
        """Say whether it is inside the rim of its dish."""
        off = poses[thing, :3, 3] - self._centres[thing]
        return bool(off[:2] @ off[:2] < DISH.inner_radius**2 and off[2] < DISH.height)

    def place(self, thing: int, poses: Vector, side: int) -> Vector:  # noqa: ARG002
        """Return its slot in the dish, at the height of the side that is up now."""
        turn = self._slots[thing]
        half = float(np.abs(poses[thing, 2, :3]) @ np.array(PIECE.size)) / 2.0
        offset = np.array([_SLOT * sin(turn), _SLOT * cos(turn), half + DROP])
        return self._centres[thing] + offset

    def rest(self, thing: int, poses: Vector, side: int) -> Vector:
        """Return its slot: a hand that has put a piece upright points down."""
        return self.place(thing, poses, side)

    def above(self, place: Vector) -> float:  # noqa: ARG002
        """Return the height over the rim."""
        return self.travel

    def grasps(
        self,
        thing: int,
        poses: Vector,
        reach: float,
        other: Vector | None,  # noqa: ARG002
    ) -> Iterator[Grasps]:
        """Yield its grasps."""
        yield of_piece(poses[thing], reach)

    def room(self, points: Vector) -> Vector:
        """Return enough: a tip stays over the rim of a dish."""
        return np.full(len(points), ROOMY)
