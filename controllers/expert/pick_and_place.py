"""Pick and place: pieces into dishes. SI units, poses in the world."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import cos, pi, sin

import numpy as np

from controllers.expert.chore import DROP, SLACK
from controllers.expert.grasps import AMPLE_ROOM, Grasps, grasps_of_piece
from robots.training.dishes import DISH, PIECE
from robots.training.fixtures import DishParams
from schemas.vectors import Vector

__all__ = ["PickAndPlace"]

_SLOT = 11.5e-3
"""Distance of the slots of a dish from the dish's middle, m."""
_GONE = 0.05
"""Depth below the dishes of a fallen piece, m."""


class PickAndPlace:
    """Pieces with a dish each, carried one way, to side 1."""

    def __init__(self, goals: Mapping[str, str], dishes: Mapping[str, DishParams]) -> None:
        """`goals`: dish by piece; `dishes`: positions of the dishes."""
        self.objects = tuple(goals)
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

    def side(self, index: int, poses: Vector) -> int:
        """Return 1 inside the piece's dish, else 0."""
        return int(self.is_done(index, poses, 1))

    def middle_of(self, side: int) -> Vector:  # noqa: ARG002
        """Return the middle of all dishes."""
        return self.meeting

    def is_done(self, index: int, poses: Vector, side: int) -> bool:  # noqa: ARG002
        """Return whether a piece is inside the rim of its dish."""
        off = poses[index, :3, 3] - self._centres[index]
        return bool(off[:2] @ off[:2] < DISH.inner_radius**2 and off[2] < DISH.height)

    def place(self, index: int, poses: Vector, side: int) -> Vector:  # noqa: ARG002
        """Return the piece's slot in the dish, at the height for the piece's present attitude."""
        turn = self._slots[index]
        half = float(np.abs(poses[index, 2, :3]) @ np.array(PIECE.size)) / 2.0
        offset = np.array([_SLOT * sin(turn), _SLOT * cos(turn), half + DROP])
        return self._centres[index] + offset

    def rest(self, index: int, poses: Vector, side: int) -> Vector:
        """Return the piece's slot: after putting a piece upright the fingers point down."""
        return self.place(index, poses, side)

    def above(self, place: Vector) -> float:  # noqa: ARG002
        """Return the height over the rim."""
        return self.travel

    def grasps(
        self,
        index: int,
        poses: Vector,
        reach: float,
        other: Vector | None,  # noqa: ARG002
    ) -> Iterator[Grasps]:
        """Yield the grasps of a piece."""
        yield grasps_of_piece(poses[index], reach)

    def room(self, points: Vector) -> Vector:
        """Return `AMPLE_ROOM`: a tip stays over the rim of a dish."""
        return np.full(len(points), AMPLE_ROOM)
