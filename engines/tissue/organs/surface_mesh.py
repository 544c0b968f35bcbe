"""Tetrahedra inside a surface of another program, to a number of nodes."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np

from engines.tissue.meshing.indicator import Indicator
from engines.tissue.meshing.mesh_check import LARGEST_M, MOST_NODES, SMALLEST_M, checked_mesh
from engines.tissue.meshing.surface import Surface, bisect_long_edges, mend_surface
from engines.tissue.meshing.tet_mesh import TetMesh
from engines.tissue.organs.shape import mesher
from schemas.vectors import Vector

__all__ = ["mesh_surface"]

_CELLS_PER_CUBE = 4.0
"""Cells of the indicator along an edge of the lattice's cubes."""
_MOST_CELLS = 150
"""Cells along the longest side."""
_SPECK = 0.01
"""A part below this share of the largest part's volume is a speck."""
_LEAST_VOLUME, _MOST_VOLUME = 0.75, 1.25
"""Volume of the mesh over the volume of the body."""
_MOST_INVENTED = 0.25
"""Share of the mesh's surface far from the file's surface: above, the surface was open."""
_REPORTED = 0.01
_COUNT_TOLERANCE, _MOST_COUNT = 0.1, 1.5
"""Deviation of the number of nodes from the request that is reported; factor above which it is an error."""
_OVERLAP, _OTHER_PART = 0.75, -0.9
"""Depth of samples that are not at the surface of the body, in cells."""
_COMPARED = 20_000
"""Most places of a surface compared with the other."""


def mesh_surface(surface: Surface, nodes: int, part: int | None = None) -> tuple[TetMesh, list[str]]:
    """Return tetrahedra inside a surface (m), and the changes that were made.

    Args:
        surface: triangles with holes, overlaps, doubled vertices or wrong normals.
        nodes: about how many nodes.
        part: which part of the body, 1 for the largest; None: there is one.

    Raises ValueError with the reason and the remedy where there is no usable mesh.
    """
    size: Vector = np.ptp(surface.vertices, axis=0)
    if not SMALLEST_M <= size.max() <= LARGEST_M:
        raise ValueError(
            f"it is {size.max():.4g} m large; {SMALLEST_M:g} to {LARGEST_M:g} m are allowed: state its unit"
        )
    mended, changes = mend_surface(surface)
    spacing = float(np.prod(size) * 1.5 / nodes) ** (1.0 / 3.0)
    step = max(spacing / _CELLS_PER_CUBE, float(size.max()) / _MOST_CELLS)
    samples = bisect_long_edges(mended, step)
    field = Indicator(samples, step)
    changes += _choose_part(field, part)
    low, high = field.bounds
    mesh = mesher(field, lambda points: points, _corner(low), _corner(high))(nodes)
    changes += _differences(mesh, nodes, field, samples)
    return checked_mesh(mesh.nodes, mesh.tetrahedra), changes


def _corner(point: Vector) -> tuple[float, float, float]:
    x, y, z = point.tolist()
    return x, y, z


def _choose_part(field: Indicator, part: int | None) -> list[str]:
    """Leave one part of the body in the field, and return the changes. Raises ValueError."""
    ndimage: Any = import_module("scipy.ndimage")
    label, count = ndimage.label(field.values > 0.0)
    if not count:
        raise ValueError(
            "the surface has no inside: it is flat, open, or thinner than"
            f" {1e3 * field.step:.2g} mm. Close it, thicken it, or ask for more nodes"
        )
    cells = np.bincount(label.ravel())[1:]
    order = np.argsort(-cells, kind="stable")
    parts = int((cells >= _SPECK * cells.max()).sum())
    if part is None and parts > 1:
        volumes = ", ".join(f"{1e6 * n * field.step**3:.3g}" for n in cells[order[:parts]].tolist())
        raise ValueError(
            f"the body has {parts} parts (volumes {volumes} ml), and an organ is one: take one with"
            f" `--part 1` to `--part {parts}`, or join them"
        )
    if part is not None and not 1 <= part <= parts:
        raise ValueError(f"the body has {parts} parts, so there is no part {part}")
    field.keep(label == order[(part or 1) - 1] + 1)
    return [f"{count - parts} specks beside the body were left out"] if count > parts else []


def _differences(mesh: TetMesh, nodes: int, field: Indicator, samples: Surface) -> list[str]:
    """Return the differences of the mesh from the surface. Raises ValueError if they are too large."""
    count, kept = len(mesh.nodes), mesh.volume / field.volume
    edge = float(np.cbrt(mesh.volume / len(mesh.tetrahedra)) * 2.04)  # of a regular tetrahedron
    if count > _MOST_COUNT * nodes:
        raise ValueError(
            f"the body is too thin for {nodes} nodes: the coarsest mesh without gaps has {count}."
            f" {f'Ask for {count} nodes' if count <= MOST_NODES else 'Thicken it'}, or mesh it elsewhere and"
            " bring the tetrahedra"
        )
    if not _LEAST_VOLUME <= kept <= _MOST_VOLUME:
        raise ValueError(
            f"a mesh of {count} nodes has {100 * kept:.0f} % of the body's volume: parts thinner than its"
            f" edges of {1e3 * edge:.2g} mm are lost. Ask for more nodes (up to {MOST_NODES}), or mesh it"
            " elsewhere and bring the tetrahedra"
        )
    invented, lost = _far_shares(mesh, samples, field, edge)
    if invented > _MOST_INVENTED:
        raise ValueError(
            f"the surface is open: {100 * invented:.0f} % of the organ's surface would be invented to close"
            f" it, and at most {100 * _MOST_INVENTED:.0f} % may be. Close it first"
        )
    changes: list[str] = []
    if invented > _REPORTED:
        changes.append(f"{100 * invented:.0f} % of the surface is new: it closes holes")
    if lost > _REPORTED:
        changes.append(
            f"{100 * lost:.0f} % of the surface is farther than {1e3 * edge:.2g} mm from the mesh: thin parts"
            " are lost; more nodes keep them"
        )
    if abs(count / nodes - 1.0) > _COUNT_TOLERANCE:
        changes.append(f"{count} nodes are the nearest to {nodes} that the lattice gives")
    return changes


def _far_shares(mesh: TetMesh, samples: Surface, field: Indicator, far: float) -> tuple[float, float]:
    """Return the share of the mesh's surface far from the samples, and of the body's surface from the mesh.

    Samples inside the body, where two parts overlap, and samples of other parts do not count.
    """
    tree: Any = import_module("scipy.spatial").cKDTree
    skin = bisect_long_edges(Surface(mesh.nodes, mesh.triangles), field.step)
    shares: list[float] = []
    for here, there in ((skin, samples), (samples, skin)):
        compared = slice(None, None, len(here.triangles) // _COMPARED + 1)
        places, areas = here.middles[compared], np.linalg.norm(here.area_vectors[compared], axis=1)
        if here is samples:
            depth = field(places) / field.step
            areas = np.where((depth > _OVERLAP) | (depth < _OTHER_PART), 0.0, areas)
        distances = tree(there.middles).query(places)[0]
        shares.append(float(areas[distances > far].sum() / max(float(areas.sum()), 1e-30)))
    return shares[0], shares[1]
