"""Peg transfer: rings between the posts of a board. SI units, poses in the world."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np

from controllers.expert.chore import DROP, SLACK
from controllers.expert.fallen_rings import Around, grasps_of_fallen_ring
from controllers.expert.grasps import AMPLE_ROOM, UPRIGHT_COSINE, Grasps, grasps_of_ring, shut_fingers
from controllers.expert.outlines import box_of_ring, outline_gap, outline_of_ring
from controllers.expert.reach import LINK_RADII
from robots.training.fixtures import BoardParams
from schemas.vectors import Vector

__all__ = ["PegBoard"]

_GONE = 0.05
"""Depth below the board of a fallen ring, m."""
_LEANS = tuple(np.radians([0.0, 15.0, 30.0]).tolist())
"""Tilts of the fingers from the vertical, rad; the last tilt extends the reach of an arm by 5 mm."""
_GRID = 4.0e-3
"""Grid of candidate points on the board for putting a ring upright, m."""
_ENOUGH = 8.0e-3
"""Clearance about a ring without further benefit, m."""
_PER_WAY = 0.05
"""Cost of a metre of travel to a candidate point, in metres of clearance."""
_APART = 1.0e-3
"""Gap to other rings at the target without further benefit, m."""
_SHIFTS = np.array([[0, 0], *([i, j] for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j)], np.float64)
"""Offsets of a ring from the middle of its post, in halves of the play around the post."""
_PER_SHIFT = 10.0
"""Cost of a metre of offset, in metres of travel."""


class PegBoard:
    """Rings on the posts of a board, one ring a post; side 1 has the target posts."""

    def __init__(self, objects: tuple[str, ...], params: BoardParams) -> None:
        """`objects`: names of the rings."""
        self.objects, self._board = objects, params.measures
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
        """Return the middles of upright rings at points (n, 2) of the board, m, shape (n, 3)."""
        flat = np.column_stack([points, np.full(len(points), self._board.ring.height / 2.0)])
        return flat @ self._pose[:3, :3].T + self._pose[:3, 3]

    def _walls(self) -> tuple[tuple[Vector, Vector], ...]:
        if (wall := self._board.wall) is None:
            return ()
        half = np.array(wall.size) / 2.0
        signs = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T
        corners = ([*wall.centre, half[2]] + signs * half) @ self._pose[:3, :3].T + self._pose[:3, 3]
        return ((corners.min(axis=0), corners.max(axis=0)),)

    def side(self, index: int, poses: Vector) -> int:
        """Return the side nearest to a ring."""
        off = [float(np.linalg.norm((poses[index, :3, 3] - middle)[:2])) for middle in self._middles]
        return int(off[1] < off[0])

    def middle_of(self, side: int) -> Vector:
        """Return the middle of a side's posts."""
        return self._middles[side]

    def is_done(self, index: int, poses: Vector, side: int) -> bool:
        """Return whether a ring is upright and down around a post of the side."""
        pose, ring = poses[index], self._board.ring
        off = np.abs(pose[:3, 3] - self._sides[side])
        there = (np.hypot(off[:, 0], off[:, 1]) < ring.inradius) & (off[:, 2] < ring.height / 2.0)
        return bool(there.any()) and abs(float(pose[2, 2])) > UPRIGHT_COSINE

    def place(self, index: int, poses: Vector, side: int) -> Vector:
        """Return the place around the side's nearest free post, clear of other rings at the present yaw.

        To avoid contact a ring is put off the middle of a post, or on another post.
        """
        posts, others = self._sides[side], np.delete(poses, index, axis=0)
        free = np.array([post for post in posts if self._is_free(post, others[:, :3, 3])])
        ring, middle = self._board.ring, poses[index, :2, 3]
        outline = outline_of_ring(ring, poses[index]) - middle
        outlines = [outline_of_ring(ring, other) for other in others]
        aside = (ring.inradius - self._board.post_radius) / 2.0
        ways = [
            (
                float(np.linalg.norm(post[:2] - middle) + _PER_SHIFT * aside * np.linalg.norm(shift)),
                post,
                shift,
            )
            for post, shift in product(free, _SHIFTS)
        ]
        best, place = -np.inf, free[0]
        for _, post, shift in sorted(ways, key=lambda way: way[0]):
            at = post[:2] + aside * shift
            room = min([_APART, *(outline_gap(outline + at, other) for other in outlines)])
            if room > best:
                best, place = room, np.append(at, post[2] + DROP)
            if room == _APART:
                break
        return place

    def _is_free(self, post: Vector, others: Vector) -> bool:
        off = others[:, :2] - post[:2]
        return not bool(((off**2).sum(axis=1) < self._board.ring.side**2 / 4.0).any())

    def rest(self, index: int, poses: Vector, side: int) -> Vector:
        """Return the point of the side, near the object, with most room between posts, wall and rings."""
        x, y = (np.arange(_GRID - size / 2.0, size / 2.0, _GRID) for size in self._board.size[:2])
        points = self._on_board(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2))
        here, there = (np.linalg.norm((points - self._middles[k])[:, :2], axis=1) for k in (side, 1 - side))
        points = points[here < there]
        around = self._board.ring.side / np.sqrt(3.0)  # of the circle through its corners
        others = np.delete(poses[:, :3, 3], index, axis=0)
        room = np.full(len(points), np.inf)
        for objects, radius in (self._posts, self._board.post_radius), (others, around):
            for each in objects:
                off = np.linalg.norm((points - each)[:, :2], axis=1)
                room = np.minimum(room, off - around - radius)
        for least, greatest in self._boxes:
            off = np.maximum(np.maximum(least - points, points - greatest)[:, :2], 0.0)
            room = np.minimum(room, np.linalg.norm(off, axis=1) - around)
        edge = np.array(self._board.size[:2]) / 2.0 - np.abs(
            (points - self._pose[:3, 3]) @ self._pose[:3, :2]
        )
        room = np.minimum(room, edge.min(axis=1) - around)
        way = np.linalg.norm((points - poses[index, :3, 3])[:, :2], axis=1)
        place = points[int((np.minimum(room, _ENOUGH) - _PER_WAY * way).argmax())].copy()
        place[2] += DROP
        return place

    def above(self, place: Vector) -> float:  # noqa: ARG002
        """Return the height just over the posts."""
        return self.clear + self._board.ring.height / 2.0 - SLACK / 2.0

    def grasps(self, index: int, poses: Vector, reach: float, other: Vector | None) -> Iterator[Grasps]:
        """Yield the grasps of a ring, clear of the post in the ring or, after a fall, of all obstacles.

        First from straight above, then with tilted fingers, at last without regard to other rings.
        """
        pose, ring = poses[index], self._board.ring
        near = [each for each in np.delete(poses, index, axis=0) if self._is_near(each, pose)]
        if abs(float(pose[2, 2])) < UPRIGHT_COSINE:
            for others in (near, []) if near else ([],):
                yield grasps_of_fallen_ring(ring, pose, reach, self._ring_surroundings(pose[:3, 3], others))
            return
        off = self._posts - pose[:3, 3]
        nearest = int((off[:, :2] ** 2).sum(axis=1).argmin())
        within = -off[nearest, 2] < self._board.post_height
        post = (self._posts[nearest, :2], self._board.post_radius) if within else None
        outlines = [outline_of_ring(ring, each) for each in near]
        if other is not None:
            outlines.append(shut_fingers(other, reach, ring.thickness))
        for beside in (outlines, []) if outlines else ([],):
            for lean in _LEANS:
                yield grasps_of_ring(ring, pose, reach, post, lean, beside)

    def _is_near(self, other: Vector, pose: Vector) -> bool:
        """Return whether the fingers at a ring with `pose` come near another ring."""
        off = other[:3, 3] - pose[:3, 3]
        return bool(np.linalg.norm(off) < 2.0 * self._board.ring.side)

    def _ring_surroundings(self, middle: Vector, others: list[Vector]) -> Around:
        local = np.abs((middle - self._pose[:3, 3]) @ self._pose[:3, :2])
        on_board = bool((local < np.array(self._board.size[:2]) / 2.0).all())
        floor = self._top if on_board else self._table
        top = self._top + self._board.post_height
        boxes = (*self._boxes, *(box_of_ring(self._board.ring, other) for other in others))
        return Around(floor, self._posts[:, :2], self._board.post_radius, top, boxes)

    def room(self, points: Vector) -> Vector:
        """Return the clearance of wrist and shaft from posts and walls, m."""
        room = np.full(points.shape[:2], AMPLE_ROOM)
        over = np.maximum(points[..., 2] - self._top - self._board.post_height, 0.0)
        for x, y, _ in self._posts:
            off = np.hypot(points[..., 0] - x, points[..., 1] - y)
            room = np.minimum(room, np.hypot(off, over) - self._board.post_radius - LINK_RADII)
        for least, greatest in self._boxes:
            off = np.maximum(np.maximum(least - points, points - greatest), 0.0)
            room = np.minimum(room, np.linalg.norm(off, axis=-1) - LINK_RADII)
        least_room: Vector = room.min(axis=1)
        return least_room
