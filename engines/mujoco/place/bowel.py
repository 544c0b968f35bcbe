"""A loop of bowel along a line."""

from __future__ import annotations

import numpy as np

from engines.mujoco.place.part import PlacePart, sheet
from engines.mujoco.textures.tissues import TISSUES
from schemas.vectors import Vector

__all__ = ["bowel_tube"]


def bowel_tube(line: Vector, radius: float, around: int, seed: int) -> PlacePart:
    """Return a tube of bowel along a line, shape (k, 3), m: narrower and wider by turns.

    `around`: cells around it.
    """
    ways = np.gradient(line, axis=0)
    steps = np.linalg.norm(ways, axis=1)
    ahead = ways / steps[:, None]
    aside = np.cross(ahead, [0.0, 0.0, 1.0])
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    up = np.cross(aside, ahead)
    along = np.cumsum(steps)
    width = radius * (1.0 + 0.10 * np.sin(along / 0.011 + seed) + 0.05 * np.sin(along / 0.004 + 3.0 * seed))
    ends = np.minimum(along, along[-1] - along) / (1.5 * radius)
    width *= np.sqrt(np.clip(2.0 * ends - ends * np.abs(ends), 0.0, 1.0)) * (ends < 1.0) + (ends >= 1.0)

    def place(u: Vector, v: Vector) -> Vector:
        index = np.rint(v * (len(line) - 1)).astype(np.int64)
        turn = 2.0 * np.pi * (u - 0.25)  # the seam is below
        across = np.cos(turn)[:, None] * aside[index] + np.sin(turn)[:, None] * up[index]
        return line[index] + width[index, None] * across

    part = sheet(place, (0.08, float(along[-1])), (around, len(line) - 1), TISSUES["bowel"], 0.08)
    return part._replace(faces=part.faces[:, ::-1], is_shaded=False)
