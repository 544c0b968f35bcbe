"""What is to be done: which things belong where, and how each is taken. SI units, poses in the world."""

from __future__ import annotations

from collections.abc import Mapping
from math import cos, pi, sin
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from controllers.expert.grasps import Grasps, of_piece, of_ring
from robots.training.dishes import DISH, PIECE
from robots.training.fixtures import BoardParams, DishParams
from schemas.vectors import Vector

__all__ = ["Chore", "PegBoard", "PickAndPlace"]


class Chore(Protocol):
    """The things of one task, by index, and what is known of them from their poses alone."""

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

    def is_done(self, thing: int, poses: Vector) -> bool:
        """Say whether a thing is where it belongs, given the poses (n, 4, 4) of all."""
        ...

    def place(self, thing: int, poses: Vector) -> Vector:
        """Return where the middle of a thing is to be when the jaw opens, m."""
        ...

    def above(self, place: Vector) -> float:
        """Return the height of a thing's middle, just over `place`, at which it is brought in line, m."""
        ...

    def grasps(self, thing: int, pose: Vector, reach: float) -> Grasps:
        """Return how a thing with `pose`, shape (4, 4), can be taken by fingers as long as `reach`, m."""
        ...


_SLACK = 6.0e-3
"""Between what is carried and what it passes over, m."""
_DROP = 0.8e-3
"""From where a jaw lets go to where the thing comes to rest, m."""


class PickAndPlace:
    """Pieces, each of which belongs in a dish."""

    _SLOT = 11.5e-3
    """Of the places in a dish from its middle, m."""

    def __init__(self, goals: Mapping[str, str], dishes: Mapping[str, DishParams]) -> None:
        """Take which dish each piece belongs in, and where the dishes are."""
        self.things = tuple(goals)
        self._centres = [np.array(dishes[dish].position) for dish in goals.values()]
        mates = list(goals.values())
        self._slots = [
            2.0 * pi * mates[:i].count(dish) / max(3, mates.count(dish)) for i, dish in enumerate(mates)
        ]
        floor = max(centre[2] for centre in self._centres)
        self.clear = float(floor + DISH.height + _SLACK)
        self.travel = self.clear + PIECE.size[2] / 2.0
        self.meeting = np.mean(self._centres, axis=0)
        self.meeting[2] = self.travel

    def is_done(self, thing: int, poses: Vector) -> bool:
        """Say whether it is inside the rim of its dish."""
        off = poses[thing, :3, 3] - self._centres[thing]
        return bool(off[:2] @ off[:2] < DISH.inner_radius**2 and off[2] < DISH.height)

    def place(self, thing: int, poses: Vector) -> Vector:
        """Return its slot in the dish, at the height of the side that is up now."""
        turn = self._slots[thing]
        half = float(np.abs(poses[thing, 2, :3]) @ np.array(PIECE.size)) / 2.0
        offset = np.array([self._SLOT * sin(turn), self._SLOT * cos(turn), half + _DROP])
        return self._centres[thing] + offset

    def above(self, place: Vector) -> float:  # noqa: ARG002
        """Return the height over the rim."""
        return self.travel

    def grasps(self, thing: int, pose: Vector, reach: float) -> Grasps:  # noqa: ARG002
        """Return its grasps."""
        return of_piece(pose, reach)


class PegBoard:
    """Rings, which belong on the target posts of a board, one each."""

    def __init__(self, things: tuple[str, ...], params: BoardParams) -> None:
        """Take the names of the rings, and the board."""
        self.things, self._board = things, params.measures
        self._pose = params.pose
        self._posts = self._around()
        self._targets = self._posts[list(self._board.targets)]
        top, ring = float(self._pose[2, 3]), self._board.ring
        highest = max(self._board.post_height, self._board.wall.size[2] if self._board.wall else 0.0)
        self.clear = top + self._board.post_height + _SLACK
        self.travel = top + highest + _SLACK + ring.height / 2.0
        centre = self._board.wall.centre if self._board.wall else (0.0, 0.0)
        self.meeting = self._pose[:3, :3] @ np.array([*centre, 0.0]) + self._pose[:3, 3]
        self.meeting[2] = self.travel

    def _around(self) -> Vector:
        """Return the middles of rings that lie around all posts, m, shape (posts, 3)."""
        posts = self._board.posts
        flat = np.column_stack([posts, np.full(len(posts), self._board.ring.height / 2.0)])
        return flat @ self._pose[:3, :3].T + self._pose[:3, 3]

    def is_done(self, thing: int, poses: Vector) -> bool:
        """Say whether it is around any of the target posts and down."""
        return bool(self._on_target(poses[thing, :3, 3]).any())

    def _on_target(self, middle: Vector) -> NDArray[np.bool_]:
        off = np.abs(middle - self._targets)
        return (np.hypot(off[:, 0], off[:, 1]) < self._board.ring.inradius) & (
            off[:, 2] < self._board.ring.height / 2.0
        )

    def place(self, thing: int, poses: Vector) -> Vector:
        """Return the place around the nearest free target post."""
        others = np.delete(poses[:, :3, 3], thing, axis=0)
        free = [i for i, post in enumerate(self._targets) if self._is_free(post, others)]
        off = self._targets[free] - poses[thing, :3, 3]
        place = self._targets[free[int((off[:, :2] ** 2).sum(axis=1).argmin())]].copy()
        place[2] += _DROP
        return place

    def _is_free(self, post: Vector, others: Vector) -> bool:
        off = others[:, :2] - post[:2]
        return not bool(((off**2).sum(axis=1) < self._board.ring.side**2 / 4.0).any())

    def above(self, place: Vector) -> float:  # noqa: ARG002
        """Return the height just over the posts."""
        return self.clear + self._board.ring.height / 2.0 - _SLACK / 2.0

    def grasps(self, thing: int, pose: Vector, reach: float) -> Grasps:  # noqa: ARG002
        """Return its grasps, clear of the post that it is around."""
        off = self._posts - pose[:3, 3]
        near = int((off[:, :2] ** 2).sum(axis=1).argmin())
        within = -off[near, 2] < self._board.post_height
        post = (self._posts[near, :2], self._board.post_radius) if within else None
        return of_ring(self._board.ring, pose, reach, post)
