"""What a shape of organ is: a mesh for a number of nodes, and surfaces with names."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from engines.bullet.meshing.isosurface_stuffing import Field, fill
from engines.bullet.meshing.smoothing import smoothed
from engines.bullet.meshing.tet_mesh import TetMesh
from schemas.errors import did_you_mean
from schemas.vectors import Vector

__all__ = ["ROUNDING_DIGITS", "SIDES", "Shape", "Surface", "mesher", "on_side", "smooth_union"]

Surface = Callable[[Vector], NDArray[np.bool_]]
"""Of nodes on the surface at rest, shape (n, 3), m, in the organ's own frame: which of them belong to a named
part, shape (n,).
"""

ROUNDING_DIGITS = 6
"""Nodes are rounded to a micrometre: sine and root differ in their last bit between processors, of which
smoothing makes 1e-13 m; meshes must not differ.
"""

_COUNT_TOLERANCE = 0.02
_SEARCHES = 8
"""The spacing is varied until the number of nodes is this near to the requested one, at most so many times;
then the nearest is taken.
"""

_SIDE_SHARE = 0.05
"""A side takes what lies within this share of the organ's extent from its end."""

SIDES = {"left": (0, -1), "right": (0, 1), "front": (1, -1), "back": (1, 1), "bottom": (2, -1), "top": (2, 1)}
"""Axis and sign of the surfaces that every organ has: where it ends towards -x, +x, -y, +y, -z and +z of its
own frame.
"""


@dataclass(frozen=True)
class Shape:
    """A body that can be meshed with about as many nodes as requested."""

    description: str
    """What it is, how it lies in its frame, and where its dimensions come from."""
    mesh: Callable[[int], TetMesh]
    """From the requested number of nodes to the nearest mesh that the method gives, in the organ's frame."""
    surfaces: Mapping[str, Surface]
    """Parts of the surface by name, besides `SIDES`."""
    anchors: tuple[str, ...]
    """Surfaces that are anchored by default."""
    material: str | None
    """The default preset."""

    def surface(self, name: str, nodes: Vector) -> NDArray[np.bool_]:
        """Return which nodes of the surface, shape (n, 3), belong to the part of it called `name`.

        Raises ValueError if it does not exist.
        """
        if name in self.surfaces:
            return self.surfaces[name](nodes)
        if name not in SIDES:
            raise ValueError(f"the organ has no surface '{name}'.{did_you_mean(name, self.names)}")
        return on_side(nodes, name, _SIDE_SHARE)

    @property
    def names(self) -> list[str]:
        """Names of all surfaces."""
        return sorted({*self.surfaces, *SIDES})


def on_side(nodes: Vector, side: str, share: float) -> NDArray[np.bool_]:
    """Return which nodes, shape (n, 3), lie near the end of the body on one of `SIDES`, shape (n,).

    `share`: of the body's extent, within which they count as near.
    """
    axis, sign = SIDES[side]
    along = sign * nodes[:, axis]
    return along >= along.max() - share * np.ptp(along)


def mesher(
    field: Field,
    formed: Callable[[Vector], Vector],
    low: tuple[float, float, float],
    high: tuple[float, float, float],
) -> Callable[[int], TetMesh]:
    """Return the function that meshes a body with a number of nodes.

    The lattice cannot hold what is thinner than itself, so a body that is thick everywhere is meshed and then
    given its form.

    Args:
        field: of the thick body.
        formed: map of points, shape (n, 3), from the thick body to the real one.
        low: corner of a box around the thick body, m.
        high: its opposite corner.
    """

    @lru_cache(maxsize=16)
    def mesh(nodes: int) -> TetMesh:
        corners = np.array(low), np.array(high)
        spacing = float(np.cbrt(1.5 * np.prod(corners[1] - corners[0]) / nodes))
        tried: dict[int, tuple[float, TetMesh]] = {}
        for _ in range(_SEARCHES):
            found = fill(field, *corners, spacing)
            count = len(found.nodes)
            tried[count] = spacing, found
            if abs(count / nodes - 1.0) <= _COUNT_TOLERANCE:
                break
            spacing *= (count / nodes) ** 0.4
        spacing, best = tried[min(tried, key=lambda count: abs(count - nodes))]
        thick = smoothed(best, field, spacing)
        return TetMesh(np.round(formed(thick.nodes), ROUNDING_DIGITS), thick.tetrahedra)

    return mesh


def smooth_union(one: Vector, other: Vector, blend: float) -> Vector:
    """Return the field of two bodies that blend where their fields differ by less than `blend` (m)."""
    return np.maximum(one, other) + np.maximum(blend - np.abs(one - other), 0.0) ** 2 / (4.0 * blend)
