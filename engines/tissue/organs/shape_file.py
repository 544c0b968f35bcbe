"""The shape of an organ in a file: of `trocar organs import`, tetrahedra of another program, or a surface."""

from __future__ import annotations

from functools import lru_cache, partial
from pathlib import Path

from engines.tissue.files.mesh_file import is_surface, read_surface, read_tetrahedra
from engines.tissue.meshing.mesh_check import checked_mesh
from engines.tissue.meshing.surface import Surface
from engines.tissue.meshing.tet_mesh import TetMesh
from engines.tissue.organs.organ_file import OrganFile
from engines.tissue.organs.shape import Shape
from engines.tissue.organs.surface_mesh import mesh_surface

__all__ = ["ORGAN_SUFFIXES", "is_surface_file", "read_shape"]

ORGAN_SUFFIXES = (".yaml", ".yml")
"""Suffixes of files of `trocar organs import`."""


def is_surface_file(path: Path) -> bool:
    """Whether a file holds a surface, by its suffix."""
    return path.suffix not in ORGAN_SUFFIXES and is_surface(path)


@lru_cache(maxsize=16)
def read_shape(path: Path, unit: float, nodes: int) -> Shape:
    """Return the shape; `unit`: m, `nodes`: of a surface. Raises ValueError, naming the file."""
    if path.suffix in ORGAN_SUFFIXES:
        return _read_organ(path)
    if is_surface(path):
        surface = read_surface(path)
        read = partial(mesh_surface, Surface(unit * surface.vertices, surface.triangles), nodes)
    else:
        points, tetrahedra = read_tetrahedra(path)
        read = partial(checked_mesh, points * unit, tetrahedra)
    try:
        found = read()
    except ValueError as error:
        raise ValueError(f"mesh {path}: {error}") from error
    mesh = found if isinstance(found, TetMesh) else found[0]
    return Shape(description=str(path), mesh=lambda _: mesh, surfaces={}, anchors=(), material=None)


def _read_organ(path: Path) -> Shape:
    content = OrganFile.load(path)
    try:
        mesh = content.tet_mesh
    except ValueError as error:
        raise ValueError(f"organ {path}: {error}") from error
    return Shape(
        description=str(path),
        mesh=lambda _: mesh,
        surfaces={},
        anchors=content.anchors,
        material=content.material,
        picks=content.surfaces,
    )
