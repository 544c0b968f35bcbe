"""A dry lab around boards and pads: a draped table, and a wall behind."""

from __future__ import annotations

import numpy as np

from engines.mujoco.place.part import PlacePart, ripple, sheet
from engines.mujoco.textures.things import drape, plaster
from schemas.vectors import Vector

__all__ = ["make_dry_lab"]

_TABLE, _ROOM, _CEILING = 0.9, 1.4, 1.6
"""Side of the table, radius and height of the room, m."""


def make_dry_lab(low: Vector, high: Vector, seed: int = 0) -> list[PlacePart]:
    """Return the surroundings of a training set in a box from `low` to `high`, m, which lies on the drape.

    `seed`: of the folds.
    """
    centre = np.array([*(0.5 * (low + high))[:2], low[2]])
    footprint = 0.5 * float(np.linalg.norm((high - low)[:2]))

    def table(u: Vector, v: Vector) -> Vector:
        x, y = (u - 0.5) * _TABLE, (v - 0.5) * _TABLE
        outside = np.clip((np.hypot(x, y) - 0.8 * footprint) / 0.05, 0.0, 1.0)
        folds = 0.004 * ripple(x, y, 0.09, 4 + seed) + 0.002 * np.abs(ripple(x, y, 0.03, 6 + seed))
        return centre + np.stack([x, y, folds * outside - 0.0008 - 0.004 * outside], axis=1)

    def wall(u: Vector, v: Vector) -> Vector:
        turn = 2.0 * np.pi * u
        return centre + np.stack([_ROOM * np.cos(turn), _ROOM * np.sin(turn), _CEILING * (v - 0.3)], axis=1)

    behind = sheet(wall, (8.0, _CEILING), (24, 2), plaster, 0.5)
    return [
        sheet(table, (_TABLE, _TABLE), (60, 60), drape, 0.12),
        behind._replace(faces=behind.faces[:, ::-1]),
    ]
