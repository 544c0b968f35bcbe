"""Random differences between episodes in what cameras see, all from one seed."""

from __future__ import annotations

from zlib import crc32

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from engines.mujoco.textures.noise import SEED, Noise, Points
from engines.mujoco.textures.surface import Recipe, Surface
from hub.participant import Params
from robots import rotation
from robots.transform import rigid_transform
from schemas.quantity import Angle, Length
from schemas.vectors import Vector

__all__ = ["RandomiseParams", "Variation"]


class RandomiseParams(Params):
    """Largest differences of what a camera sees from what is stated; uniform between the limits."""

    seed: int = Field(ge=0, lt=1 << 32, description="the same seed draws the same pictures")
    textures: bool = Field(default=True, description="vessels, lobules and stains lie elsewhere")
    colour: float = Field(
        default=0.1, ge=0.0, le=0.5, description="share of red, green and blue of each tissue, more or less"
    )
    light: float = Field(
        default=0.1, ge=0.0, le=0.5, description="share of red and blue of the lamp, more or less"
    )
    exposure: float = Field(default=0.5, ge=0.0, le=3.0, description="stops, more or less")
    offset: Length = Field(
        default=2e-3, ge=0.0, description="of the cameras along each of their axes, either way"
    )
    turn: Angle = Field(
        default=0.035, ge=0.0, le=0.5, description="of the cameras about each of their axes, either way"
    )
    smoke: float = Field(default=0.3, ge=0.0, le=1.0, description="most smoke")
    background: bool = Field(default=True, description="surroundings have other shapes and colours")


class Variation:
    """The differences of one seed; without parameters none."""

    def __init__(self, params: RandomiseParams | None) -> None:
        self._params = params

    def _random(self, part: str) -> np.random.Generator:
        """Return random numbers of a part: no part depends on which others vary."""
        return np.random.default_rng([0 if self._params is None else self._params.seed, crc32(part.encode())])

    def _within(self, part: str, limit: float, size: int) -> Vector:
        return self._random(part).uniform(-limit, limit, size)

    @property
    def texture_seed(self) -> int:
        """Seed of the noise behind all textures."""
        if self._params is None or not self._params.textures:
            return SEED
        return int(self._random("textures").integers(1 << 31))

    @property
    def place_seed(self) -> int:
        """Seed of the shapes of surroundings."""
        if self._params is None or not self._params.background:
            return 0
        return int(self._random("place").integers(1, 1 << 31))

    def recolour(self, recipe: Recipe, name: str) -> Recipe:
        """Return a recipe with the colour of the tissue `name`."""
        if self._params is None or not self._params.colour:
            return recipe
        factors = (1.0 + self._within(f"colour of {name}", self._params.colour, 3)).astype(np.float32)

        def surface(noise: Noise, points: Points) -> Surface:
            found = recipe(noise, points)
            return found._replace(colour=found.colour * factors)

        return surface

    def recolour_place(self, recipe: Recipe, number: int) -> Recipe:
        """Return a recipe with the colour of a part of the surroundings."""
        is_varied = self._params is not None and self._params.background
        return self.recolour(recipe, f"place {number}") if is_varied else recipe

    @property
    def lamp_colour(self) -> Vector:
        """Factors of red, green and blue of the lamp, shape (3,)."""
        red, blue = self._within("lamp", 0.0 if self._params is None else self._params.light, 2)
        return np.array([1.0 + red, 1.0, 1.0 + blue])

    @property
    def exposure(self) -> float:
        """Stops."""
        return float(self._within("exposure", 0.0 if self._params is None else self._params.exposure, 1)[0])

    @property
    def smoke(self) -> float:
        """From 0 to 1."""
        return float(self._random("smoke").uniform(0.0, 0.0 if self._params is None else self._params.smoke))

    @property
    def mounting(self) -> NDArray[np.float64]:
        """Pose of the cameras in the optical frame that is stated, shape (4, 4)."""
        if self._params is None:
            return np.eye(4)
        turn = rotation.exp(self._within("turn", self._params.turn, 3))
        return rigid_transform(rotation.matrix(turn), self._within("offset", self._params.offset, 3))
