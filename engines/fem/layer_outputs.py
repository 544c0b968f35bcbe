"""Outputs of layered organs: length over which a layer is freed, volumes of lost and of dead tissue."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from engines.fem.faces import FACE_CORNERS
from engines.fem.organ import Organ
from engines.tissue.organs.layers import BASE
from engines.tissue.organs.params import OrganParams
from hub.participant import signal_out
from schemas.ports import Port
from schemas.vectors import Vector

__all__ = ["LayerOutputs", "layer_ports"]


_MEANINGS = {
    "freed": (
        "area over which the layer has come off the tissue below, over the width of the block along y",
        "m",
    ),
    "lost": ("volume at rest of tissue that has gone", "m^3"),
    "dead": ("volume at rest of tissue that is dead or has gone", "m^3"),
}
"""Meaning and unit of the outputs of a layer."""


def layer_ports(organs: Mapping[str, OrganParams], period_ns: int) -> tuple[Port, ...]:
    """Return the ports of all organs with layers."""
    return tuple(
        signal_out(f"{organ}/{layer}/{name}", description=meaning, unit=unit, period_ns=period_ns)
        for organ, params in organs.items()
        for layer in _names(params)
        for name, (meaning, unit) in _MEANINGS.items()
        if (layer, name) != (BASE, "freed")
    )


def _names(params: OrganParams) -> tuple[str, ...]:
    return (*(layer.name for layer in params.layers), BASE) if params.layers else ()


class LayerOutputs:
    """Reads the faces between the layers of an organ, and its elements."""

    def __init__(self, organ: Organ, params: OrganParams) -> None:
        """Begin with an organ that is whole."""
        assert params.size is not None
        self._organ, self._names, self._width = organ, _names(params), params.size[1]
        self._volumes = organ.solid.volumes.astype(np.float64)
        solid, layers = organ.solid, organ.layers
        across, above = solid.across, np.repeat(layers, 4)
        joined = np.flatnonzero(across >= 0)
        down = joined[above[joined] < above[across[joined]]]
        corners = FACE_CORNERS[down % 4]
        nodes = organ.mesh.nodes[np.take_along_axis(solid.tetrahedra[down // 4], corners, axis=1)]
        edges = nodes[:, 1:] - nodes[:, :1]
        self._faces: NDArray[np.int64] = down
        self._above = above[down]
        self._areas: Vector = 0.5 * np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)

    def outputs(self, dead: NDArray[np.bool_] | None = None) -> dict[str, Vector]:
        """Return the values. `dead`: elements whose cells are dead, shape (m,); default: none."""
        solid, count = self._organ.solid, len(self._names)
        lost = solid.volumes == 0.0
        opened = np.where(solid.across[self._faces] < 0, self._areas, 0.0)
        values = {
            "freed": np.bincount(self._above, opened, count) / self._width,
            "lost": self._volumes_of(lost),
            "dead": self._volumes_of(lost if dead is None else lost | dead),
        }
        return {
            f"{self._organ.name}/{layer}/{name}": found[i : i + 1]
            for i, layer in enumerate(self._names)
            for name, found in values.items()
            if (layer, name) != (BASE, "freed")
        }

    def _volumes_of(self, chosen: NDArray[np.bool_]) -> Vector:
        """Return the volume of the chosen elements in each layer, m^3."""
        found = np.bincount(self._organ.layers, np.where(chosen, self._volumes, 0.0), len(self._names))
        return found.astype(np.float64)
