"""Mutated meshes of organs, .vtk files in text and binary: each is an organ, or raises ScenarioError.

`python -m tests.fuzz.meshes --number 1000 --seed 7 --hours 1`; `--case 7:123` repeats one mesh.
"""

from __future__ import annotations

import random
import sys
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from engines.tissue.meshing.tet_mesh import TetMesh
from engines.tissue.organs.params import OrganParams
from tests.fuzz.byte_mutations import mutated, mutated_text
from tests.fuzz.harness import Note, Target, search
from tests.participants import make_participant

ORGAN = {"mesh": "organ.vtk", "young_modulus": "10 kPa"}
ANCHORS = [[], [{"box": {"low": ["-1 m", "-1 m", "-1 m"], "high": ["1 m", "1 m", "1 m"]}}]]


def _text(mesh: TetMesh) -> bytes:
    with TemporaryDirectory() as folder:
        mesh.write_vtk(file := Path(folder, "organ.vtk"))
        return file.read_bytes()


def _binary(mesh: TetMesh, version: str) -> bytes:
    """Return a binary file; since version 5 cells are offsets and connectivity."""
    count, cells = len(mesh.tetrahedra), mesh.tetrahedra
    head = f"# vtk DataFile Version {version}\norgan\nBINARY\nDATASET UNSTRUCTURED_GRID\n"
    points = f"POINTS {len(mesh.nodes)} double\n".encode() + mesh.nodes.astype(">f8").tobytes()
    if version == "5.1":
        offsets = np.arange(0, 4 * count + 1, 4).astype(">i8").tobytes()
        text = f"\nCELLS {count + 1} {4 * count}\nOFFSETS vtktypeint64\n".encode() + offsets
        text += b"\nCONNECTIVITY vtktypeint64\n" + cells.astype(">i8").tobytes()
    else:
        rows = np.column_stack([np.full(count, 4), cells]).astype(">i4").tobytes()
        text = f"\nCELLS {count} {5 * count}\n".encode() + rows
    types = np.full(count, 10).astype(">i4").tobytes()
    return head.encode() + points + text + f"\nCELL_TYPES {count}\n".encode() + types


@cache
def _seeds() -> dict[str, bytes]:
    edges = ["60 mm", "60 mm", "20 mm"]
    organ = OrganParams.model_validate({"size": edges, "nodes": 60, "young_modulus": "10 kPa", "anchors": []})
    mesh = organ.local
    few = TetMesh(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]]) / 50, np.array([[0, 1, 2, 3]]))
    return {
        "text": _text(mesh),
        "one tetrahedron": _text(few),
        "binary": _binary(mesh, "4.2"),
        "binary, one tetrahedron": _binary(few, "4.2"),
        "version 5": _binary(mesh, "5.1"),
        "version 5, one tetrahedron": _binary(few, "5.1"),
    }


def _read(data: bytes, anchors: object, directory: Path) -> None:
    """Make the engine of a scenario with this organ, and its ports."""
    (directory / "organ.vtk").write_bytes(data)
    params = {"organs": {"organ": {**ORGAN, "anchors": anchors}}}
    _ = make_participant("bullet", "tissue", params, directory).ports


def attempt(case: str, directory: Path, note: Note) -> None:
    """Read the mesh of `case`, SEED:NUMBER."""
    source = random.Random(case)
    name, data = source.choice(sorted(_seeds().items()))
    text = not name.startswith(("binary", "version"))
    change = mutated_text if text or source.random() < 0.3 else mutated
    label, data = change(data, source, list(_seeds().values()))
    note(f"{name}: {label}")
    organs = directory / case.replace(":", "-")  # a mesh that was read is known by its path
    organs.mkdir()
    _read(data, source.choice(ANCHORS), organs)


def pristine(directory: Path) -> None:
    """Read each file as it is."""
    for name, data in _seeds().items():
        organs = directory / name
        organs.mkdir(exist_ok=True)
        _read(data, [], organs)


if __name__ == "__main__":
    sys.exit(search(Target(attempt, pristine, batch=20), __doc__ or "", hours=0.25))
