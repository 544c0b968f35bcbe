"""Tetrahedra of an organ's voxels, to a number of nodes, and their differences from the voxels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from typing import Any

import numpy as np

from engines.tissue.meshing.isosurface_stuffing import Field
from engines.tissue.meshing.mesh_check import MOST_NODES, checked_mesh
from engines.tissue.meshing.surface import Surface, bisect_long_edges
from engines.tissue.meshing.tet_mesh import TetMesh
from engines.tissue.organs.label_body import LabelBody
from engines.tissue.organs.label_tube import LabelTube
from engines.tissue.organs.shape import mesher
from schemas.vectors import Vector

__all__ = ["LabelMesh", "mesh_body"]

_LEAST_VOLUME, _MOST_VOLUME = 0.8, 1.2
"""Volume of a first mesh over that of the voxels; outside, parts are lost or closed."""
_CLOSE, _CORRECTIONS = 0.01, 6
"""Relative error of the volume that ends the corrections, and most of them."""
_MORE, _OTHER, _TRIES = 1.6, 1.05, 12
"""Factors of the nodes from try to try, of a thin organ and of a flaw of the lattice; most tries."""
_GAP = 0.25
"""Distance to a smaller organ that touches, in voxels."""


@dataclass(frozen=True)
class LabelMesh:
    """Tetrahedra of a body."""

    body: LabelBody
    mesh: TetMesh
    offset: float
    """Distance of surface nodes outside the body, m: edges are chords, and lose what the offset adds."""

    @property
    def volume_ratio(self) -> float:
        """Volume of the mesh over that of the voxels."""
        return self.mesh.volume / self.body.field.raw_volume

    @cached_property
    def distances(self) -> tuple[float, float]:
        """Largest distance between surface and voxels' boundary, and that of 95 in 100 places, m."""
        tree: Any = import_module("scipy.spatial").cKDTree
        places = bisect_long_edges(_skin(self.mesh), self.body.field.spacing).middles
        out: Vector = tree(self.body.boundary).query(places)[0]
        back: Vector = tree(places).query(self.body.boundary)[0]
        return float(max(out.max(), back.max())), float(np.quantile(out, 0.95))


Neighbour = LabelMesh | LabelTube


def mesh_body(body: LabelBody, others: Sequence[Neighbour], nodes: int) -> LabelMesh:
    """Return tetrahedra with the volume of the voxels.

    Args:
        body: voxels.
        others: organs that keep their place where they touch this one.
        nodes: about how many; a thin body gets more.

    Raises ValueError with the reason where there is no usable mesh.
    """
    found, wanted = _first_mesh(body, others, nodes)
    offset, volume = 0.0, body.field.raw_volume
    for _ in range(_CORRECTIONS):
        missing = volume - found.volume
        if abs(missing) < _CLOSE * volume:
            break
        wider = offset + missing / float(np.linalg.norm(_skin(found).area_vectors, axis=1).sum())
        mesh = _mesh(body, others, round(wanted), wider)
        if _problem(mesh):
            wanted *= _OTHER
        elif abs(volume - mesh.volume) < abs(missing):
            found, offset = mesh, wider
    return LabelMesh(body, found, offset)


def _first_mesh(body: LabelBody, others: Sequence[Neighbour], nodes: int) -> tuple[TetMesh, float]:
    """Return a sound mesh and for how many nodes it was made. Raises ValueError, naming the organ."""
    problem, wanted = "", float(nodes)
    for _ in range(_TRIES):
        if wanted > MOST_NODES:
            break
        try:
            found = _mesh(body, others, round(wanted), 0.0)
        except ValueError as error:
            problem, wanted = str(error), _MORE * wanted
            continue
        ratio = found.volume / body.field.raw_volume
        if not _LEAST_VOLUME <= ratio <= _MOST_VOLUME:
            problem = f"a mesh of {len(found.nodes)} nodes has {100 * ratio:.0f} % of the voxels' volume"
            wanted *= _MORE
        elif flaw := _problem(found):
            problem, wanted = flaw, _OTHER * wanted
        else:
            return found, wanted
    raise ValueError(f"{body.name} cannot be meshed with up to {MOST_NODES} nodes, is it too thin? {problem}")


def _problem(mesh: TetMesh) -> str:
    """Return why a mesh cannot be used; empty: it can."""
    try:
        checked_mesh(mesh.nodes, mesh.tetrahedra)
    except ValueError as error:
        return str(error)
    return ""


def _mesh(body: LabelBody, others: Sequence[Neighbour], nodes: int, offset: float) -> TetMesh:
    """Return a mesh, perhaps with flaws. Raises ValueError where there is none."""
    low, high = body.field.bounds
    field = _field(body, others, offset)
    return mesher(field, lambda points: points, _corner(low - offset), _corner(high + offset))(nodes)


def _field(body: LabelBody, others: Sequence[Neighbour], offset: float) -> Field:
    """Return the field of a body, larger by `offset` (m), with a gap to others."""
    gap = _GAP * body.field.spacing

    def field(points: Vector) -> Vector:
        values = body.field(points) + offset
        for other in others:
            values = np.minimum(values, -other.body.field(points) - other.offset - gap)
        return values

    return field


def _corner(point: Vector) -> tuple[float, float, float]:
    x, y, z = point.tolist()
    return x, y, z


def _skin(mesh: TetMesh) -> Surface:
    return Surface(mesh.nodes, mesh.triangles)
