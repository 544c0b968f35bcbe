"""Where organs join: loose tissue over both, so that a tube grows out of its organ without a seam."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from engines.mujoco.textures.noise import Noise, Points, Values
from engines.mujoco.textures.surface import Recipe, Surface, smooth_step
from engines.mujoco.textures.tissues import areolar

__all__ = ["joined_recipes"]

_MM = 1e-3
_JOINING = frozenset({"artery", "duct", "gallbladder"})
"""Tissues with such joints."""
_FULL, _REACH = 1.5 * _MM, 4.0 * _MM
"""Distance from the other organ up to which loose tissue hides the organ, and from which there is none, m."""
_RAGGED = 0.8 * _MM
"""Way by which the edge of loose tissue winds, m."""
_CELL, _CANDIDATES = 2.0 * _MM, 6
"""Side of a cell, m, and the nodes among which the nearest of all points of a cell is sought."""


def joined_recipes(
    recipes: Mapping[str, Recipe], tissues: Mapping[str, str], rest: Mapping[str, Points]
) -> dict[str, Recipe]:
    """Return the recipes of organs by name, with loose tissue where two organs meet.

    Args:
        recipes: of the organs alone.
        tissues: names of tissues.
        rest: nodes at rest, shape (n, 3), m, frame `world`.
    """
    joining = [name for name in recipes if tissues[name] in _JOINING]
    found = dict(recipes)
    for name, recipe in recipes.items():
        others = [rest[one] for one in (joining if name not in joining else recipes) if one != name]
        if others and joining:
            found[name] = _joined(recipe, np.concatenate(others))
    return found


def _joined(recipe: Recipe, others: Points) -> Recipe:
    def surface(noise: Noise, points: Points) -> Surface:
        bare = recipe(noise, points)
        distance = _distances(points, others)
        near = np.flatnonzero(distance < _REACH + 4.0 * _RAGGED)
        there = points[near]
        ragged = distance[near] + np.float32(_RAGGED) * noise.octaves(there, 2.0 * _MM, 60, 2)
        share = 1.0 - smooth_step(ragged, _FULL, _REACH)
        loose = areolar(noise, there)
        colour, height, roughness = (np.array(values) for values in bare)
        colour[near] += share[:, None] * (loose.colour - colour[near])
        height[near] += share * (loose.height - height[near])
        roughness[near] += share * (loose.roughness - roughness[near])
        return Surface(colour, height, roughness)

    return surface


def _distances(points: Points, others: Points) -> Values:
    """Return the distance of each point to the nearest of `others`, m, shape (n,); far away about."""
    place = np.floor(points / _CELL).astype(np.int64)
    place -= place.min(axis=0)
    size = place.max(axis=0) + 1
    key = (place[:, 0] * size[1] + place[:, 1]) * size[2] + place[:, 2]
    _, first, cell = np.unique(key, return_index=True, return_inverse=True)
    centres = (np.floor(points[first] / _CELL) + 0.5) * _CELL
    apart = np.linalg.norm(centres[:, None] - others, axis=2)
    count = min(_CANDIDATES, len(others))
    candidates = np.argpartition(apart, count - 1, axis=1)[:, :count]
    found = np.full(len(points), np.inf)
    for nodes in candidates.T:
        found = np.minimum(found, np.linalg.norm(points - others[nodes[cell]], axis=1))
    return found.astype(np.float32)
