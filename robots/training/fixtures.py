"""The fixed things of a training scene as a scenario states them: which one, and where it is."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from robots import rotation
from robots.dvrk.parameters import UnitQuaternion
from robots.training.boards import BOARDS, Board
from robots.training.phantoms import PHANTOMS, Phantom, PhantomName
from schemas.quantity import Length
from schemas.vectors import Vector

__all__ = ["BoardName", "BoardParams", "DiscBoxParams", "DishParams", "FixtureParams", "PhantomParams"]

BoardName = Literal["icra2026", "surrol", "fls"]
"""A key of `BOARDS`."""


class _Fixture(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    position: tuple[Length, Length, Length] = Field(description="of its frame in the world")
    orientation: UnitQuaternion = Field(
        default=(0.0, 0.0, 0.0, 1.0), description="of its frame in the world: quaternion x, y, z, w"
    )

    @property
    def pose(self) -> Vector:
        """Its frame in the world, shape (4, 4), m."""
        pose = np.eye(4)
        pose[:3, :3] = rotation.matrix(np.array(self.orientation))
        pose[:3, 3] = self.position
        return pose


class BoardParams(_Fixture):
    """A board with posts; its frame is in the middle of its top, x to the surgeon's right, z up."""

    kind: Literal["board"]
    board: BoardName

    @property
    def measures(self) -> Board:
        """Its posts, wall and rings."""
        return BOARDS[self.board]


class DishParams(_Fixture):
    """A round dish with an upright rim; its frame is in the middle of its underside, z up."""

    kind: Literal["dish"]


class PhantomParams(_Fixture):
    """A pad to be sutured; its frame is in the middle of its skin, x to the surgeon's right, z up.

    What stands in the scene is the base under the skin; the skin itself is a participant of kind
    `suture-pad`.
    """

    kind: Literal["phantom"]
    phantom: PhantomName

    @property
    def measures(self) -> Phantom:
        """Its skin, base and holes."""
        return PHANTOMS[self.phantom]


class DiscBoxParams(_Fixture):
    """A red box with four white discs (`robots.training.targets`); its frame is amid the discs, z up."""

    kind: Literal["disc-box"]


FixtureParams = Annotated[
    BoardParams | DishParams | PhantomParams | DiscBoxParams, Field(discriminator="kind")
]
"""One thing that stands fast."""
