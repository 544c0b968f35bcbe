"""Reads meshes of strangers: surfaces (STL, OBJ, PLY, glTF) and tetrahedra (VTK, MSH, MED).

Size and kind of a file are checked before a parser sees the content. Parsers of other people run in a
process of their own, with limits of memory and time: a crash or an endless loop there is a message here.
"""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from engines.tissue.files.parser import MESHIO_READERS, TRIMESH_SUFFIXES
from engines.tissue.files.vtk_file import read_vtk
from engines.tissue.meshing.surface import Surface
from engines.tissue.meshing.tet_mesh import Indices, compact, volumes
from schemas.errors import MissingExtraError
from schemas.vectors import Vector

__all__ = ["SURFACE_SUFFIXES", "TETRAHEDRA_SUFFIXES", "is_surface", "read_surface", "read_tetrahedra"]

SURFACE_SUFFIXES = TRIMESH_SUFFIXES
TETRAHEDRA_SUFFIXES = (".vtk", *MESHIO_READERS)

_LARGEST_FILE = 128 * 10**6
"""Bytes: an STL of two and a half million triangles."""
_PATIENCE_S = 180.0
"""Wall time for a parser; a file of the largest size takes some 10 s."""


def is_surface(path: Path) -> bool:
    """Return whether a file holds a surface, by its suffix."""
    return path.suffix.lower() in SURFACE_SUFFIXES


def read_surface(path: Path) -> Surface:
    """Return the triangles of a file, in the file's unit. Raises ValueError, naming the file."""
    arrays = _parse(path, ("trimesh", "scipy"))
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
    arrays = _parse(path, ("meshio", "h5py") if path.suffix.lower() == ".med" else ("meshio",))
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


def _parse(path: Path, packages: tuple[str, ...]) -> dict[str, Vector]:
    """Return the arrays of `engines.tissue.files.parser`, which needs `packages`."""
    for package in packages:
        if find_spec(package) is None:
            raise MissingExtraError(f"mesh {path}", "meshes", package)
    _require_small_file(path)
    with TemporaryDirectory(prefix="trocar-") as directory:
        result = Path(directory) / "mesh.npz"
        command = [sys.executable, "-P", "-m", "engines.tissue.files.parser", str(path), str(result)]
        try:
            done = subprocess.run(
                command, capture_output=True, timeout=_PATIENCE_S, check=False, stdin=subprocess.DEVNULL
            )
        except subprocess.TimeoutExpired as error:
            raise ValueError(
                f"mesh {path}: its parser took more than {_PATIENCE_S:g} s; is it {path.suffix}?"
            ) from error
        if done.returncode or not result.is_file():
            raise ValueError(f"mesh {path} is no {path.suffix} file that can be read: {_reason(done)}")
        with np.load(result, allow_pickle=False) as arrays:
            return dict(arrays)


def _require_small_file(path: Path) -> None:
    """Raise ValueError unless `path` is a regular file of at most `_LARGEST_FILE` bytes."""
    try:
        if not path.is_file():
            raise ValueError(f"mesh {path} is no file" if path.exists() else f"mesh {path}: no such file")
        size = path.stat().st_size
    except OSError as error:
        raise ValueError(f"mesh {path} cannot be read: {error.strerror}") from error
    if size > _LARGEST_FILE:
        raise ValueError(
            f"mesh {path} has {size // 10**6} MB; at most {_LARGEST_FILE // 10**6} MB are read: decimate it"
        )


def _reason(done: subprocess.CompletedProcess[bytes]) -> str:
    lines = done.stderr.decode("utf-8", "replace").strip().splitlines()
    if done.returncode < 0 or not lines:
        return f"its parser ended with {done.returncode}"
    return "".join(sign if sign.isprintable() else "?" for sign in lines[-1])[:200]
