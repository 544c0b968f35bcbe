"""From files of other programs to the file of an organ: unit, frame, mesh, surfaces, report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from engines.tissue.files.mesh_file import (
    SURFACE_SUFFIXES,
    TETRAHEDRA_SUFFIXES,
    is_surface,
    read_surface,
    read_tetrahedra,
)
from engines.tissue.meshing.mesh_check import LARGEST_M, SMALLEST_M, checked_mesh
from engines.tissue.meshing.surface import Surface, join_surfaces
from engines.tissue.meshing.tet_mesh import Indices, TetMesh, compact
from engines.tissue.organs.organ_file import OrganFile
from engines.tissue.organs.picks import SurfacePick
from engines.tissue.organs.shape import ROUNDING_DIGITS, SIDES
from schemas.errors import ScenarioError, did_you_mean
from schemas.files import file_hash
from schemas.vectors import Vector

__all__ = ["FACTORS", "ImportedOrgan", "Unit", "import_organ"]

Unit = Literal["m", "cm", "mm"]
FACTORS: Mapping[str, float] = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
"""Unit of files, m."""

_NODES = 250
"""Run in real time at sub-steps of 1 ms (docs/decisions/0014-organs.md)."""


@dataclass(frozen=True)
class ImportedOrgan:
    """An organ, ready to write, and what was done to the files."""

    file: OrganFile
    mesh: TetMesh
    report: list[str]
    """Sentences: unit, frame, changes."""


def import_organ(
    paths: Sequence[Path],
    *,
    nodes: int | None = None,
    unit: Unit | None = None,
    part: int | None = None,
    keep_origin: bool = False,
    surfaces: Mapping[str, SurfacePick] | None = None,
    anchors: Sequence[str] = ("bottom",),
    material: str | None = None,
) -> ImportedOrgan:
    """Return the organ in files of other programs.

    Args:
        paths: surfaces, taken together, or one file of tetrahedra.
        nodes: about how many; None: 250 inside a surface, all of a file of tetrahedra.
        unit: unit of the files; None: guessed from their size.
        part: which part of a body in several, 1 for the largest.
        keep_origin: whether the frame stays; else its origin goes to the middle of the top, as of a block.
        surfaces: named parts of the surface.
        anchors: surfaces anchored by default.
        material: the default preset.

    Raises ScenarioError with the file, the reason and the remedy where there is no usable organ.
    """
    label = ", ".join(map(str, paths))
    try:
        read = _read(paths)
        report: list[str] = []
        factor = FACTORS[_unit(read[0], unit, report)]
        mesh = _make_mesh(read, factor, nodes, part, report)
        shift = np.zeros(3) if keep_origin else _middle_of_top(mesh.nodes)
        if shift.any():
            report.append(
                f"origin: the middle of the top, {_in_mm(shift)} mm in the file; --keep-origin keeps its own"
            )
        mesh = TetMesh(np.round(mesh.nodes - shift, ROUNDING_DIGITS), mesh.tetrahedra)
        picks = dict(surfaces or {})
        _check_surfaces(mesh, picks, anchors, report)
        source = {
            "files": {path.name: file_hash(path) for path in paths},
            "unit_m": factor,
            "origin_m": shift.tolist(),
            "report": list(report),
        }
        file = OrganFile(
            source=source,
            material=material,
            anchors=tuple(anchors),
            surfaces={**picks},
            mesh=mesh.vtk_text,
        )
    except ValueError as error:
        prefix = "" if str(error).startswith("mesh ") else f"mesh {label}: "
        raise ScenarioError(f"{prefix}{error}") from error
    return ImportedOrgan(file, mesh, report)


def _read(paths: Sequence[Path]) -> tuple[Vector, Indices]:
    """Return points and triangles, shape (f, 3), or tetrahedra, shape (m, 4)."""
    for path in paths:
        if path.suffix.lower() not in (*SURFACE_SUFFIXES, *TETRAHEDRA_SUFFIXES):
            raise ValueError(
                f"mesh {path}: a file of kind '{path.suffix}' is not read; surfaces:"
                f" {', '.join(SURFACE_SUFFIXES)}; tetrahedra: {', '.join(TETRAHEDRA_SUFFIXES)}"
            )
    if all(is_surface(path) for path in paths):
        return join_surfaces([read_surface(path) for path in paths])
    if len(paths) > 1:
        raise ValueError("several files are taken together only if all are surfaces; name one of tetrahedra")
    return read_tetrahedra(paths[0])


def _unit(points: Vector, stated: Unit | None, report: list[str]) -> Unit:
    """Return the unit of the files: as stated, or m or mm, whichever makes an organ of the size."""
    size = float(np.ptp(points, axis=0).max()) if len(points) else 0.0
    if stated is not None:
        return stated
    guess: Unit = "mm" if size > LARGEST_M else "m"
    if not SMALLEST_M <= size * FACTORS[guess] <= LARGEST_M:
        raise ValueError(
            f"it is {size:.4g} units large, which is no organ ({SMALLEST_M:g} to {LARGEST_M:g} m) in m or mm:"
            f" state --unit, one of {', '.join(FACTORS)}"
        )
    extent = size * FACTORS[guess]
    report.append(f"unit {guess}, as the longest side is then {1e3 * extent:.4g} mm; --unit states another")
    return guess


def _make_mesh(
    read: tuple[Vector, Indices], factor: float, nodes: int | None, part: int | None, report: list[str]
) -> TetMesh:
    """Return the mesh, m, and add to the report."""
    points, cells = factor * read[0], read[1]
    if cells.shape[1] == 4 and nodes is None:
        if part is not None:
            raise ValueError("--part chooses a part of a surface: state --nodes to mesh the surface anew")
        return checked_mesh(points, cells)
    if cells.shape[1] == 4:
        body = compact(points, cells)
        points, cells = body.nodes, body.triangles
        report.append(f"the surface of {len(body.nodes)} nodes is meshed anew")
    from engines.tissue.organs.surface_mesh import mesh_surface

    mesh, changes = mesh_surface(Surface(points, cells), nodes or _NODES, part)
    report += changes
    return mesh


def _middle_of_top(nodes: Vector) -> Vector:
    x, y, _ = 0.5 * (nodes.min(axis=0) + nodes.max(axis=0))
    return np.round(np.array([x, y, nodes[:, 2].max()], np.float64), ROUNDING_DIGITS)


def _check_surfaces(
    mesh: TetMesh, picks: Mapping[str, SurfacePick], anchors: Sequence[str], report: list[str]
) -> None:
    """Raise ValueError for a pick without nodes or an unknown anchor; add the picks to the report."""
    for name, pick in picks.items():
        picked = pick.nodes(mesh)
        if not picked.any():
            low, high = mesh.nodes.min(axis=0), mesh.nodes.max(axis=0)
            raise ValueError(
                f"surface '{name}' has no node; the organ reaches from {_in_mm(low)} to {_in_mm(high)} mm"
            )
        report.append(f"surface '{name}' has {int(picked.sum())} nodes")
    known = [*picks, *SIDES]
    for name in anchors:
        if name not in known:
            raise ValueError(f"the organ has no surface '{name}' to anchor.{did_you_mean(name, known)}")


def _in_mm(point: Vector) -> str:
    return f"({', '.join(f'{1e3 * value:.4g}' for value in point.tolist())})"
