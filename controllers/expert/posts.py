"""Rings, which are carried between the posts of a board. SI units, poses in the world."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from controllers.expert.chores import DROP, SLACK
from controllers.expert.fallen_rings import Around, of_fallen_ring
from controllers.expert.grasps import UPRIGHT, Grasps, of_ring
from robots.training.fixtures import BoardParams
from schemas.vectors import Vector

__all__ = ["PegBoard"]

_GONE = 0.05
"""Below the board, m: what is so low has fallen off the table."""
_LEANS = tuple(np.radians([0.0, 15.0, 30.0]).tolist())
"""Of the fingers from the vertical, rad: with the last one an arm reaches 5 mm further."""
_GRID = 4.0e-3
"""Between the points of the board among which one is chosen to put a ring upright, m."""
_ENOUGH = 8.0e-3
"""Room about a ring there beyond which more is no better, m."""
_PER_WAY = 0.05
"""What a metre of way to that point costs, in metres of room."""


class PegBoard:
    """Rings, which belong on the posts of one side of a board, one each: side 1 has the target posts."""

    def __init__(self, things: tuple[str, ...], params: BoardParams) -> None:
        """Take the names of the rings, and the board."""
        self.things, self._board = things, params.measures
        self._pose = params.pose
        self._posts = self._on_board(self._board.posts)
        targets = list(self._board.targets)
        self._sides = np.delete(self._posts, targets, axis=0), self._posts[targets]
        self._middles = tuple(side.mean(axis=0) for side in self._sides)
        top, ring = float(self._pose[2, 3]), self._board.ring
        highest = max(self._board.post_height, self._board.wall.size[2] if self._board.wall else 0.0)
        self._top, self._table = top, top - self._board.size[2]
        self.depth = self._table - _GONE
        self.clear = top + self._board.post_height + SLACK
        self.travel = top + highest + SLACK + ring.height / 2.0
        centre = self._board.wall.centre if self._board.wall else (0.0, 0.0)
        self.meeting = self._pose[:3, :3] @ np.array([*centre, 0.0]) + self._pose[:3, 3]
        self.meeting[2] = self.travel
        self._boxes = self._walls()

    def _on_board(self, points: Vector) -> Vector:
        """Return the middles of rings that stand upright at points (n, 2) of the board, m, shape (n, 3)."""
        flat = np.column_stack([points, np.full(len(points), self._board.ring.height / 2.0)])
        return flat @ self._pose[:3, :3].T + self._pose[:3, 3]

    def _walls(self) -> tuple[tuple[Vector, Vector], ...]:
        if (wall := self._board.wall) is None:
            return ()
        half = np.array(wall.size) / 2.0
        signs = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T
        corners = ([*wall.centre, half[2]] + signs * half) @ self._pose[:3, :3].T + self._pose[:3, 3]
        return ((corners.min(axis=0), corners.max(axis=0)),)

    def side(self, thing: int, poses: Vector) -> int:
        """Return the side whose middle is nearer."""
        off = [float(np.linalg.norm((poses[thing, :3, 3] - middle)[:2])) for middle in self._middles]
        return int(off[1] < off[0])

    def middle_of(self, side: int) -> Vector:
        """Return the middle of a side's posts."""
        return self._middles[side]

    def is_done(self, thing: int, poses: Vector, side: int) -> bool:
        """Say whether it is upright around any of the side's posts, and down."""
        pose, ring = poses[thing], self._board.ring
        off = np.abs(pose[:3, 3] - self._sides[side])
        there = (np.hypot(off[:, 0], off[:, 1]) < ring.inradius) & (off[:, 2] < ring.height / 2.0)
        return bool(there.any()) and abs(float(pose[2, 2])) > UPRIGHT

    def place(self, thing: int, poses: Vector, side: int) -> Vector:
        """Return the place around the side's nearest free post."""
        posts, others = self._sides[side], np.delete(poses[:, :3, 3], thing, axis=0)
        free = [i for i, post in enumerate(posts) if self._is_free(post, others)]
        off = posts[free] - poses[thing, :3, 3]
        place = posts[free[int((off[:, :2] ** 2).sum(axis=1).argmin())]].copy()
        place[2] += DROP
        return place

    def _is_free(self, post: Vector, others: Vector) -> bool:
        off = others[:, :2] - post[:2]
        return not bool(((off**2).sum(axis=1) < self._board.ring.side**2 / 4.0).any())

    def rest(self, thing: int, poses: Vector, side: int) -> Vector:
        """Return the point of the side, near the thing, with most room between posts, wall and rings."""
        x, y = (np.arange(_GRID - size / 2.0, size / 2.0, _GRID) for size in self._board.size[:2])
        points = self._on_board(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2))
        here, there = (np.linalg.norm((points - self._middles[k])[:, :2], axis=1) for k in (side, 1 - side))
        points = points[here < there]
        around = self._board.ring.side / np.sqrt(3.0)  # of the circle through its corners
        others = np.delete(poses[:, :3, 3], thing, axis=0)
        room = np.full(len(points), np.inf)
        for things, radius in (self._posts, self._board.post_radius), (others, around):
            for each in things:
                off = np.linalg.norm((points - each)[:, :2], axis=1)
                room = np.minimum(room, off - around - radius)
        for least, greatest in self._boxes:
            off = np.maximum(np.maximum(least - points, points - greatest)[:, :2], 0.0)
            room = np.minimum(room, np.linalg.norm(off, axis=1) - around)
        edge = np.array(self._board.size[:2]) / 2.0 - np.abs(
            (points - self._pose[:3, 3]) @ self._pose[:3, :2]
        )
        room = np.minimum(room, edge.min(axis=1) - around)
        way = np.linalg.norm((points - poses[thing, :3, 3])[:, :2], axis=1)
        place = points[int((np.minimum(room, _ENOUGH) - _PER_WAY * way).argmax())].copy()
        place[2] += DROP
        return place

    def above(self, place: Vector) -> float:  # noqa: ARG002
        """Return the height just over the posts."""
        return self.clear + self._board.ring.height / 2.0 - SLACK / 2.0

    def grasps(self, thing: int, pose: Vector, reach: float) -> Iterator[Grasps]:  # noqa: ARG002
        """Yield its grasps, clear of the post that it is around, or of all that is about a fallen one.

        From straight above, then from a hand that leans.
        """
        if abs(float(pose[2, 2])) < UPRIGHT:
            yield of_fallen_ring(self._board.ring, pose, reach, self._surroundings(pose[:3, 3]))
            return
        off = self._posts - pose[:3, 3]
        near = int((off[:, :2] ** 2).sum(axis=1).argmin())
        within = -off[near, 2] < self._board.post_height
        post = (self._posts[near, :2], self._board.post_radius) if within else None
        for lean in _LEANS:
            yield of_ring(self._board.ring, pose, reach, post, lean)

    def _surroundings(self, middle: Vector) -> Around:
        local = np.abs((middle - self._pose[:3, 3]) @ self._pose[:3, :2])
        on_board = bool((local < np.array(self._board.size[:2]) / 2.0).all())
        floor = self._top if on_board else self._table
        top = self._top + self._board.post_height
        return Around(floor, self._posts[:, :2], self._board.post_radius, top, self._boxes)
