"""Reads meshes of strangers: surfaces (STL, OBJ, PLY, glTF) and tetrahedra (VTK, MSH, MED).

Size and kind of a file are checked before a parser sees the content. Parsers of other people run in a
process of their own, with limits of memory and time: a crash or an endless loop there is a message here.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from engines.tissue.files.foreign_file import parse_file
from engines.tissue.files.parser import MESHIO_READERS, TRIMESH_SUFFIXES
from engines.tissue.files.vtk_file import read_vtk
from engines.tissue.meshing.surface import Surface
from engines.tissue.meshing.tet_mesh import Indices, compact, volumes
from schemas.vectors import Vector

__all__ = ["SURFACE_SUFFIXES", "TETRAHEDRA_SUFFIXES", "is_surface", "read_surface", "read_tetrahedra"]

SURFACE_SUFFIXES = TRIMESH_SUFFIXES
TETRAHEDRA_SUFFIXES = (".vtk", *MESHIO_READERS)

_PARSER = "engines.tissue.files.parser"


def is_surface(path: Path) -> bool:
    """Return whether a file holds a surface, by its suffix."""
    return path.suffix.lower() in SURFACE_SUFFIXES


def read_surface(path: Path) -> Surface:
    """Return the triangles of a file, in the file's unit. Raises ValueError, naming the file."""
    arrays = parse_file(path, _PARSER, ("trimesh", "scipy"))
    vertices, triangles = arrays["vertices"], arrays["triangles"].astype(np.int64)
    if not len(triangles) or not np.isfinite(vertices).all() or not _are_indices(triangles, len(vertices)):
        raise ValueError(
            f"mesh {path}: it has {len(vertices)} vertices and {len(triangles)} triangles; triangles must be"
            " of finite vertices that are there"
        )
    return Surface(vertices, triangles)


def read_tetrahedra(path: Path) -> tuple[Vector, Indices]:
    """Return nodes, shape (n, 3), in the file's unit, and tetrahedra, shape (m, 4).

    Raises ValueError, naming the file.
    """
    if path.suffix.lower() not in MESHIO_READERS:
        return read_vtk(path)
    arrays = parse_file(path, _PARSER, ("meshio", "h5py") if path.suffix.lower() == ".med" else ("meshio",))
    nodes, tetrahedra = arrays["nodes"], arrays["tetrahedra"].astype(np.int64)
    if nodes.shape[1:] != (3,) or not _are_indices(tetrahedra, len(nodes)):
        raise ValueError(f"mesh {path}: its tetrahedra name nodes that there are not")
    # such files list nodes of surfaces and points beside the volume's
    mesh = compact(nodes, tetrahedra)
    if (volumes(mesh.nodes, mesh.tetrahedra) < 0.0).all():  # MED counts the other way round
        return mesh.nodes, mesh.tetrahedra[:, [0, 1, 3, 2]]
    return mesh.nodes, mesh.tetrahedra


def _are_indices(indices: Indices, count: int) -> bool:
    return bool(((indices >= 0) & (indices < count)).all())
