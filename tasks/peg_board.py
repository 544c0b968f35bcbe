"""Carrying rings from post to post of a peg board."""

from __future__ import annotations

from typing import ClassVar, Self

import numpy as np
from pydantic import Field, model_validator

from hub.participant import Params
from robots import rotation
from robots.training.fixtures import BoardParams
from schemas.vectors import Vector
from tasks.goals import Goals
from tasks.params import TaskParams
from tasks.task import Task

__all__ = ["PegBoardParams", "PegBoardTask"]

_MARGIN, _BELOW, _ABOVE = 0.02, 0.01, 0.15
"""Workspace: m beside, below and above the top of the board. Without a source."""
_UPRIGHT = 0.7
"""Least cosine of the angle between ring and post for a ring on its post: some 45 degrees."""


class PegBoardParams(TaskParams):
    """The board, and rules of the board for the task itself."""

    open_to_pages: ClassVar[bool] = True

    legs: int | None = Field(
        default=1,
        ge=1,
        description="1: all rings over the board; 2: and back, ...; null: until the session ends",
    )
    hand_over: bool | None = Field(
        default=None,
        description=(
            "whether a ring counts only after a hand-over; default: on a board with a wall. Rules of others"
            " decide for themselves"
        ),
    )

    @model_validator(mode="after")
    def _has_one_board(self) -> Self:
        boards = [name for name, one in self.fixtures.items() if isinstance(one, BoardParams)]
        if len(boards) != 1:
            raise ValueError(
                f"the scene has {len(boards)} boards{': ' if boards else ''}{', '.join(boards)}; one is"
                " needed: `fixtures: {board: {kind: board, board: icra2026, ...}}`"
            )
        return self

    @property
    def board(self) -> BoardParams:
        """The board with its pose."""
        return next(one for one in self.fixtures.values() if isinstance(one, BoardParams))


class PegBoardTask(Task):
    """All rings to their target posts.

    A ring lies on a post if the post is in the ring's hole, the ring is lower than the post's top, and
    upright within 45 degrees.
    """

    params_model: ClassVar[type[Params]] = PegBoardParams
    name_of_kind: ClassVar[str] = "peg-board-task"
    is_board: ClassVar[bool] = True

    def __init__(self, name: str, params: PegBoardParams) -> None:
        super().__init__(name, params)
        self._board, self._pose = params.board.measures, params.board.pose
        asked = params.hand_over
        self._hand_over = self._board.wall is not None if asked is None else asked
        self._leg_count = params.legs

    @property
    def goals(self) -> Goals:
        """The posts; a ring may start on any post on the side of the start posts."""
        board, count = self._board, len(self.things)
        targets = frozenset(board.targets)
        starts = frozenset(range(len(board.posts))) - targets
        local = np.column_stack([board.posts, np.full(len(board.posts), 0.5 * board.ring.height)])
        return Goals(
            places=tuple(f"post{i}" for i in range(len(board.posts))),
            positions=local @ self._pose[:3, :3].T + self._pose[:3, 3],
            starts=(starts,) * count,
            targets=(targets,) * count,
            hand_over=self._hand_over,
        )

    @property
    def goal_count(self) -> int:
        """Number of rings times legs; 0: until the session ends."""
        return len(self.things) * (self._leg_count or 0)

    @property
    def workspace(self) -> Vector:
        """A box about the board, m, shape (2, 3)."""
        x, y = 0.5 * self._board.size[0] + _MARGIN, 0.5 * self._board.size[1] + _MARGIN
        corners = np.array([[i, j, k] for i in (-x, x) for j in (-y, y) for k in (-_BELOW, _ABOVE)])
        world = corners @ self._pose[:3, :3].T + self._pose[:3, 3]
        return np.stack([world.min(axis=0), world.max(axis=0)])

    def place_of(self, thing: int, pose: Vector) -> int:  # noqa: ARG002
        """Return the index of the post under a ring at `pose`, shape (7,); -1: none."""
        x, y, z = self._pose[:3, :3].T @ (pose[:3] - self._pose[:3, 3])
        axis = self._pose[:3, 2] @ rotation.matrix(pose[3:])[:, 2]
        away = np.hypot(self._board.posts[:, 0] - x, self._board.posts[:, 1] - y)
        nearest = int(away.argmin())
        inside = away[nearest] < self._board.ring.inradius and 0.0 < z < self._board.post_height
        return nearest if inside and abs(axis) > _UPRIGHT else -1
