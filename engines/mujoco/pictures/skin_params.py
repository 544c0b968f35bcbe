"""Parameters of the look of a soft body."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field

from engines.mujoco.textures.joints import joined_recipes
from engines.mujoco.textures.noise import Points
from engines.mujoco.textures.surface import Recipe
from engines.mujoco.textures.tissues import TISSUES, tinted
from hub.participant import Params

__all__ = ["Rgb", "SkinParams", "body_recipes"]

Rgb = tuple[
    Annotated[float, Field(ge=0.0, le=1.0)],
    Annotated[float, Field(ge=0.0, le=1.0)],
    Annotated[float, Field(ge=0.0, le=1.0)],
]
"""Red, green and blue, each from 0 to 1."""

_COLOURS: dict[str, Rgb] = {
    "tissue": (0.80, 0.38, 0.33),
    "adrenal": (0.83, 0.60, 0.28),
    "artery": (0.72, 0.36, 0.31),
    "bowel": (0.86, 0.55, 0.48),
    "colon": (0.86, 0.55, 0.48),
    "duct": (0.76, 0.70, 0.50),
    "fat": (0.90, 0.76, 0.42),
    "gallbladder": (0.46, 0.52, 0.42),
    "kidney": (0.60, 0.24, 0.20),
    "liver": (0.52, 0.20, 0.15),
    "muscle": (0.60, 0.22, 0.18),
    "peritoneum": (0.80, 0.52, 0.45),
    "skin": (0.80, 0.38, 0.33),
    "thread": (0.35, 0.1, 0.55),
}
"""Chosen by eye for a white lamp at the camera, after descriptions of the living organs in anatomy: liver and
kidney red-brown, the liver darker; the colon a greyish pink; the adrenal gland the yellow of its cortex; the
gallbladder green with bile, ducts paler, arteries pink in their sheath; `tissue`, for all others and the skin
of a pad, the pink of muscle. A thread is violet, as sutures of polyglactin are dyed.
"""


class SkinParams(Params):
    """The look of one soft body."""

    colour: (
        Literal[
            "tissue",
            "adrenal",
            "artery",
            "bowel",
            "colon",
            "duct",
            "fat",
            "gallbladder",
            "kidney",
            "liver",
            "muscle",
            "peritoneum",
            "skin",
        ]
        | Rgb
        | None
    ) = Field(
        default=None,
        description=(
            "name of a tissue, or red, green and blue from 0 to 1; default: the tissue whose name ends the"
            " body's name, else `tissue`"
        ),
    )

    def rgb(self, name: str) -> Rgb:
        """Return red, green and blue, each from 0 to 1, of the body `name`."""
        if isinstance(self.colour, tuple):
            return self.colour
        return _COLOURS[self.tissue(name)]

    def recipe(self, name: str) -> Recipe:
        """Return the recipe of the textures of the body `name`."""
        if isinstance(self.colour, tuple):
            return tinted(TISSUES["tissue"], self.colour)
        tissue = self.tissue(name)
        return TISSUES[tissue] if tissue in TISSUES else tinted(TISSUES["tissue"], _COLOURS[tissue])

    def tissue(self, name: str) -> str:
        """Return the tissue of the body `name`: as stated, else by the end of the name."""
        if isinstance(self.colour, str):
            return self.colour
        return next(filter(name.endswith, _COLOURS), "tissue")


def body_recipes(skins: Mapping[str, SkinParams], rest: Mapping[str, Points]) -> dict[str, Recipe]:
    """Return the recipe of each body by name.

    Args:
        skins: looks; a body without one looks like the tissue whose name ends the body's name.
        rest: nodes at rest, shape (n, 3), m, frame `world`.
    """
    looks = {name: skins.get(name, SkinParams()) for name in rest}
    recipes = {name: look.recipe(name) for name, look in looks.items()}
    return joined_recipes(recipes, {name: look.tissue(name) for name, look in looks.items()}, rest)
