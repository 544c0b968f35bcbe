"""Fixtures of a training scene as stated in a scenario: kind and pose."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from robots import rotation
from robots.dvrk.parameters import UnitQuaternion
from robots.training.boards import BOARDS, Board
from robots.training.phantoms import PHANTOMS, Phantom, PhantomName
from robots.transform import rigid_transform
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
        """Pose of the fixture in the world, shape (4, 4), m."""
        return rigid_transform(rotation.matrix(np.array(self.orientation)), self.position)


class BoardParams(_Fixture):
    """A board with posts; the frame is in the middle of the top, x to the surgeon's right, z up."""

    kind: Literal["board"]
    board: BoardName

    @property
    def measures(self) -> Board:
        """Posts, wall and rings of the board."""
        return BOARDS[self.board]


class DishParams(_Fixture):
    """A round dish with an upright rim; the frame is in the middle of the underside, z up."""

    kind: Literal["dish"]


class PhantomParams(_Fixture):
    """A pad to be sutured; the frame is in the middle of the skin, x to the surgeon's right, z up.

    The fixture is the base under the skin; the skin itself is a participant of kind `suture-pad`.
    """

    kind: Literal["phantom"]
    phantom: PhantomName

    @property
    def measures(self) -> Phantom:
        """Skin, base and holes of the phantom."""
        return PHANTOMS[self.phantom]


class DiscBoxParams(_Fixture):
    """A red box with four white discs (`robots.training.targets`); the frame is amid the discs, z up."""

    kind: Literal["disc-box"]


FixtureParams = Annotated[
    BoardParams | DishParams | PhantomParams | DiscBoxParams, Field(discriminator="kind")
]
"""Parameters of a fixture."""
