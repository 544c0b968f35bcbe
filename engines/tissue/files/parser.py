"""Parses a mesh file in a process of its own: the file is a stranger's, and so are the parsers.

`python -P -m engines.tissue.files.parser FILE RESULT` writes arrays. Any exception of a parser ends the
process; the parent reads the last line of the traceback (`engines.tissue.files.mesh_file`).
"""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["MESHIO_READERS", "TRIMESH_SUFFIXES", "limit_resources"]

TRIMESH_SUFFIXES = (".stl", ".obj", ".ply", ".glb", ".gltf")
"""Surfaces."""

MESHIO_READERS = {".vtu": "meshio.vtu", ".msh": "meshio.gmsh", ".med": "meshio.med"}
"""Tetrahedra: module of the reader by suffix."""

_MEMORY, _CPU_S, _RESULT = 4 * 2**30, 120, 2**28
"""Limits of the process where the system has limits: address space, time, bytes of the result.

A compressed file may unpack to a thousand times its size.
"""


def limit_resources() -> None:
    """Bound memory, time and output of this process, where the system can."""
    try:
        resource: Any = import_module("resource")
    except ImportError:  # Windows: the parent's time limit stands alone
        return
    for kind, most in (("RLIMIT_AS", _MEMORY), ("RLIMIT_CPU", _CPU_S), ("RLIMIT_FSIZE", _RESULT)):
        resource.setrlimit(getattr(resource, kind), (most, most))


def _parse_surface(file: Path) -> dict[str, NDArray[Any]]:
    """Return vertices and triangles of all parts of a scene, z upwards."""
    trimesh: Any = import_module("trimesh")
    with file.open("rb") as content:
        # without a resolver no second file is opened, and nothing is fetched
        scene = trimesh.load_scene(
            content, file_type=file.suffix[1:].lower(), resolver=None, process=False, skip_materials=True
        )
    if not scene.geometry:
        raise ValueError("no triangles in it")
    mesh = scene.to_mesh()
    vertices = np.asarray(mesh.vertices, np.float64)
    if file.suffix.lower() in (".glb", ".gltf"):  # y is up in glTF 2.0, section 3.4
        vertices = vertices[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    return {"vertices": vertices, "triangles": np.asarray(mesh.faces, np.int64)}


def _parse_tetrahedra(file: Path) -> dict[str, NDArray[Any]]:
    """Return nodes and tetrahedra; of quadratic tetrahedra the corners."""
    reader: Any = import_module(MESHIO_READERS[file.suffix.lower()])
    mesh = reader.read(str(file))
    cells: dict[str, Any] = mesh.cells_dict
    solid = [name for name in cells if name.startswith(("hexahedron", "wedge", "pyramid", "VTK_"))]
    if solid:
        raise ValueError(f"cells of kind {', '.join(solid)}: an organ is of tetrahedra alone")
    found = [np.asarray(cells[name], np.int64)[:, :4] for name in ("tetra", "tetra10") if name in cells]
    if not found:
        raise ValueError(f"no tetrahedra in it; cells: {', '.join(cells) or 'none'}")
    return {"nodes": np.asarray(mesh.points, np.float64), "tetrahedra": np.concatenate(found)}


def main(file: Path, result: Path) -> None:
    """Parse `file`, and write arrays to `result` (.npz)."""
    limit_resources()
    parse = _parse_surface if file.suffix.lower() in TRIMESH_SUFFIXES else _parse_tetrahedra
    np.savez(result, allow_pickle=False, **parse(file))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
