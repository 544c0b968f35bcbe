"""Textures that repeat: coats of the robot, and tissue that was cut or burnt."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from engines.mujoco.textures.noise import Noise
from engines.mujoco.textures.surface import Maps, Recipe, make_tile
from engines.mujoco.textures.things import brushed_steel, shaft_coat
from engines.mujoco.textures.tissues import char, coagulum, cut_inside, cut_wall
from schemas.soft_surface import FaceKind

__all__ = ["COATS", "KINDS", "TISSUE_TILE", "Coat", "changed_coats"]

TISSUE_TILE = 0.02
"""Side of the tiles of changed tissue, m."""
_PIXELS = 256


class Coat(NamedTuple):
    """A surface in tiles."""

    recipe: Recipe
    tile: float
    """Side of a tile, m."""
    metal: float = 0.0
    """Share of metal: less than 1 for a fine blasted surface, which scatters light."""

    def maps(self, noise: Noise) -> Maps:
        """Return the maps of a tile."""
        return make_tile(self.recipe, noise, self.tile, _PIXELS, metal=self.metal > 0.0)


COATS: Mapping[str, Coat] = {"steel": Coat(brushed_steel, 0.012, 0.8), "black": Coat(shaft_coat, 0.012)}
"""Coats by the name of a material of the robot."""
KINDS: Mapping[FaceKind, Coat] = {
    FaceKind.CUT: Coat(cut_inside, TISSUE_TILE),
    FaceKind.COAGULATED: Coat(coagulum, TISSUE_TILE),
    FaceKind.CHARRED: Coat(char, TISSUE_TILE),
}
"""Coats of changed faces of tissue."""


def changed_coats(tissue: str) -> Mapping[FaceKind, Coat]:
    """Return the coats of changed faces of a tissue: the wall of a tube is pale inside."""
    return {**KINDS, FaceKind.CUT: Coat(cut_wall, TISSUE_TILE)} if tissue in ("artery", "duct") else KINDS
