"""The shape of an organ: a mesh for a number of nodes, and named surfaces."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from engines.tissue.meshing.isosurface_stuffing import Field, fill
from engines.tissue.meshing.smoothing import smoothed
from engines.tissue.meshing.tet_mesh import TetMesh
from engines.tissue.organs.picks import NodePick, SurfacePick
from schemas.errors import did_you_mean
from schemas.vectors import Vector

__all__ = ["ROUNDING_DIGITS", "SIDES", "Shape", "Surface", "mesher", "on_side", "smooth_union"]

Surface = Callable[[Vector], NDArray[np.bool_]]
"""Maps surface nodes at rest, shape (n, 3), m, in the organ's own frame, to their membership in a named part,
shape (n,).
"""

ROUNDING_DIGITS = 6
"""Digits of nodes: a micrometre. Sine and root differ in their last bit between processors, and smoothing
makes 1e-13 m of this difference; meshes must not differ.
"""

_COUNT_TOLERANCE = 0.02
_SEARCHES = 8
"""Most variations of the spacing to come near to the requested number of nodes; then the nearest mesh is
used.
"""

_SIDE_SHARE = 0.05
"""Depth of a side, as a fraction of the organ's extent."""

SIDES = {"left": (0, -1), "right": (0, 1), "front": (1, -1), "back": (1, 1), "bottom": (2, -1), "top": (2, 1)}
"""Axis and sign of the surfaces of every organ: the ends towards -x, +x, -y, +y, -z and +z of the organ's
frame.
"""


@dataclass(frozen=True)
class Shape:
    """A body for meshes with about the requested number of nodes."""

    description: str
    """Organ, attitude in its frame, and sources of the dimensions."""
    mesh: Callable[[int], TetMesh]
    """Maps the requested number of nodes to the nearest mesh of the method, in the organ's frame."""
    surfaces: Mapping[str, Surface]
    """Parts of the surface by name, besides `SIDES`."""
    anchors: tuple[str, ...]
    """Surfaces anchored by default."""
    material: str | None
    """The default preset."""
    picks: Mapping[str, SurfacePick | NodePick] = field(default_factory=dict[str, SurfacePick | NodePick])
    """Parts of the surface of a mesh, by name."""

    def surface(self, name: str, nodes: Vector) -> NDArray[np.bool_]:
        """Return the membership of surface nodes, shape (n, 3), in the part `name`, shape (n,).

        Raises ValueError for an unknown part.
        """
        if name in self.surfaces:
            return self.surfaces[name](nodes)
        if name not in SIDES:
            raise ValueError(f"the organ has no surface '{name}'.{did_you_mean(name, self.names)}")
        return on_side(nodes, name, _SIDE_SHARE)

    @property
    def names(self) -> list[str]:
        """Names of all surfaces."""
        return sorted({*self.surfaces, *self.picks, *SIDES})


def on_side(nodes: Vector, side: str, share: float) -> NDArray[np.bool_]:
    """Return whether nodes, shape (n, 3), are near the end of the body on a side of `SIDES`, shape (n,).

    `share`: depth of the side, as a fraction of the body's extent.
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
    """Return the mesher of a body for a number of nodes.

    The lattice cannot hold parts thinner than itself, so a thick body is meshed and then deformed.

    Args:
        field: field of the thick body.
        formed: map of points, shape (n, 3), from the thick body to the real body.
        low: corner of a box around the thick body, m.
        high: opposite corner of the box, m.
    """

    @lru_cache(maxsize=16)
    def mesh(nodes: int) -> TetMesh:
        corners = np.array(low), np.array(high)
        spacing = float(np.cbrt(1.5 * np.prod(corners[1] - corners[0]) / nodes))
        tried: dict[int, tuple[float, TetMesh]] = {}
        for _ in range(_SEARCHES):
            found = fill(field, *corners, spacing)
            count = len(found.nodes)
            if not count:  # the lattice went past a thin body
                spacing *= 0.5
                continue
            tried[count] = spacing, found
            if abs(count / nodes - 1.0) <= _COUNT_TOLERANCE:
                break
            spacing *= (count / nodes) ** 0.4
        if not tried:
            raise ValueError(f"no lattice of {1e3 * spacing:.2g} mm and more meets the body: it is too thin")
        spacing, best = tried[min(tried, key=lambda count: abs(count - nodes))]
        thick = smoothed(best, field, spacing)
        return TetMesh(np.round(formed(thick.nodes), ROUNDING_DIGITS), thick.tetrahedra)

    return mesh


def smooth_union(one: Vector, other: Vector, blend: float) -> Vector:
    """Return the field of two bodies, blended within a difference of their fields of `blend` (m)."""
    return np.maximum(one, other) + np.maximum(blend - np.abs(one - other), 0.0) ** 2 / (4.0 * blend)
