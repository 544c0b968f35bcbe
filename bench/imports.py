"""Organs of files of other programs: each is usable, or refused with the reason.

python bench/imports.py [FOLDER]

Ten ugly surfaces and two label maps made by code, and one in a wrong unit; then the files of a folder. Any
other end than an organ or a sentence ends the script.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import nrrd
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))  # for the tests' surfaces

from engines.tissue.example_patient import write_example
from engines.tissue.files.label_file import is_label_map, read_labels
from engines.tissue.meshing.tet_mesh import TetMesh, shape_quality
from engines.tissue.organ_import import import_organ
from engines.tissue.patient_import import import_patient
from schemas.errors import ScenarioError
from tests.engines.tissue.ugly_surfaces import UGLY, write_stl

__all__ = ["imports"]

_MOST_LABELS = 3


def imports(folder: Path | None = None) -> int:
    """Print a line for each file; return 0: no file falls short."""
    usable = 0
    with TemporaryDirectory() as scratch:
        files = [*_made(Path(scratch)), *(sorted(folder.iterdir()) if folder else ())]
        for file in files:
            begun = time.process_time()
            is_usable, detail = _import(file)
            usable += is_usable
            result = "usable" if is_usable else "refused"
            print(f"{file.name:36} {result:8} {time.process_time() - begun:5.1f} s  {detail}")
    print(f"{usable} usable, {len(files) - usable} refused with the reason")
    return 0


def _made(folder: Path) -> Iterator[Path]:
    for name, surface in UGLY.items():
        (file := folder / f"{name}.stl").write_bytes(write_stl(surface()))
        yield file
    for name in ("example.seg.nrrd", "example.nii.gz"):
        write_example(file := folder / name, seed=7)
        yield file
    voxels, header = nrrd.read(str(folder / "example.seg.nrrd"))
    header["space units"] = ["m"] * 3
    nrrd.write(str(file := folder / "example-in-metres.seg.nrrd"), voxels, header)
    yield file


def _import(file: Path) -> tuple[bool, str]:
    """Return whether a file is usable, and what became of it."""
    try:
        return True, _patient(file) if is_label_map(file) else _organ(file)
    except ScenarioError as error:
        return False, str(error).replace(f"mesh {file}: ", "")


def _organ(file: Path) -> str:
    organ = import_organ([file])
    return f"{_numbers(organ.mesh)}; {'; '.join(organ.report[:-1])}"


def _patient(file: Path) -> str:
    """Import all named labels, else the largest."""
    try:
        patient = import_patient(file, {})
    except ScenarioError as error:
        if "state --labels" not in str(error):
            raise
        counts = np.bincount(read_labels(file).labels.ravel())[1:]
        labels = {f"label{n + 1}": str(n + 1) for n in np.argsort(-counts)[:_MOST_LABELS].tolist()}
        patient = import_patient(file, labels)
    organs = [
        f"{name}: {_numbers(organ.mesh)}, {100 * organ.made.volume_ratio - 100:+.1f} % of the voxels' volume,"
        f" {1e3 * organ.made.distances[1]:.1f} mm from their boundary"
        for name, organ in patient.organs.items()
    ]
    return f"{'; '.join(organs)}; {len(patient.contacts)} attachments"


def _numbers(mesh: TetMesh) -> str:
    quality = float(shape_quality(mesh.nodes, mesh.tetrahedra).min())
    return f"{len(mesh.nodes)} nodes, quality {quality:.2f}, {1e6 * mesh.volume:.3g} ml"


if __name__ == "__main__":
    sys.exit(imports(Path(sys.argv[1]) if len(sys.argv) > 1 else None))
