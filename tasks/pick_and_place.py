"""Pieces into their dishes."""

from __future__ import annotations

from typing import ClassVar, Self

import numpy as np
from pydantic import Field, model_validator

from hub.participant import Params
from robots.training.dishes import DISH
from robots.training.fixtures import DishParams
from schemas.errors import did_you_mean
from schemas.vectors import Vector
from tasks.goals import Goals
from tasks.params import TaskParams
from tasks.task import Task

__all__ = ["PickAndPlaceParams", "PickAndPlaceTask"]

_MARGIN, _BELOW, _ABOVE = 0.05, 0.01, 0.15
"""Workspace: m beside, below and above the dishes. Without a source."""


class PickAndPlaceParams(TaskParams):
    """The dish of each piece."""

    open_to_pages: ClassVar[bool] = True

    goals: dict[str, str] = Field(
        min_length=1, description="of each piece the dish where it belongs: `{piece1: left, ...}`"
    )

    @model_validator(mode="after")
    def _knows_all(self) -> Self:
        for piece, dish in self.goals.items():
            if piece not in self.objects:
                raise ValueError(f"goals: no object '{piece}'.{did_you_mean(piece, self.objects)}")
            if dish not in self.dishes:
                raise ValueError(f"goals: no dish '{dish}'.{did_you_mean(dish, self.dishes)}")
        return self

    @property
    def dishes(self) -> dict[str, DishParams]:
        """The dishes, by name."""
        return {name: one for name, one in self.fixtures.items() if isinstance(one, DishParams)}


class PickAndPlaceTask(Task):
    """Every piece with a goal to its dish.

    A piece lies in a dish if the piece's middle is inside the rim, and not above.
    """

    params_model: ClassVar[type[Params]] = PickAndPlaceParams
    name_of_kind: ClassVar[str] = "pick-and-place-task"

    def __init__(self, name: str, params: PickAndPlaceParams) -> None:
        super().__init__(name, params)
        self._belongs, self._names = params.goals, tuple(params.dishes)
        self._dishes = [dish.pose for dish in params.dishes.values()]

    @property
    def goals(self) -> Goals:
        """The dishes."""
        dishes, belongs = self._names, self._belongs
        targets = tuple(
            frozenset(i for i, dish in enumerate(dishes) if belongs.get(thing) == dish)
            for thing in self.things
        )
        return Goals(places=dishes, targets=targets)

    @property
    def goal_count(self) -> int:
        """Number of pieces with a dish."""
        return len(self._belongs)

    @property
    def workspace(self) -> Vector:
        """A box about the dishes, m, shape (2, 3)."""
        middles = np.stack([pose[:3, 3] for pose in self._dishes])
        reach = DISH.outer_radius + _MARGIN
        low, high = np.array([reach, reach, _BELOW]), np.array([reach, reach, _ABOVE])
        return np.stack([middles.min(axis=0) - low, middles.max(axis=0) + high])

    def place_of(self, thing: int, pose: Vector) -> int:  # noqa: ARG002
        """Return the index of the dish of a piece at `pose`, shape (7,); -1: none."""
        for i, dish in enumerate(self._dishes):
            x, y, z = dish[:3, :3].T @ (pose[:3] - dish[:3, 3])
            if np.hypot(x, y) < DISH.inner_radius and 0.0 <= z <= DISH.height:
                return i
        return -1
