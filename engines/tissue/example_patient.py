"""A label map of no real patient: liver, gallbladder and cystic duct of smooth shapes and noise.

It has the faults of segmentations, an island, a hole and a bridge of one voxel, for the import to repair.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schemas.errors import MissingExtraError, ScenarioError
from schemas.vectors import Vector

__all__ = ["LABELS", "example_labels", "write_example"]

LABELS: Mapping[str, int] = {"liver": 1, "gallbladder": 2, "cystic_duct": 3}

_VOXEL = 1.25
_LOW, _HIGH = np.array([-95.0, -36.0, -64.0]), np.array([36.0, 80.0, 24.0])
"""Box of the map, mm: x to the left, y cranial, z anterior; the neck of the gallbladder is at the origin."""
_WAVES = 6
_ROUGHNESS = 0.6
"""Standard deviation of the noise of surfaces, mm."""
_SCANNER = np.array([60.0, 35.0, 1210.0])
"""The neck in the axes left, posterior, superior of a scan, mm."""

_LIVER = np.array([-30.0, 26.0, -30.0]), np.array([58.0, 46.0, 26.0])
"""Middle and half axes of a superellipsoid, mm: segments IV and V around the bed."""
_BLUNTNESS = 3.0
_GALLBLADDER = np.array([[0.0, 0.0, 0.0], [-4.0, 14.0, 1.0], [-9.0, 32.0, 3.0], [-13.0, 46.0, 4.0]])
_RADII = np.array([4.0, 9.0, 13.5, 12.0])
"""A pear, 62 mm long and 28 mm wide: an adult's is 70 to 100 mm and 25 to 30 mm (Gray, 1918)."""
_DUCT = np.array([[1.0, -2.0, 0.0], [6.0, -10.0, 2.0], [14.0, -18.0, 0.0], [20.0, -28.0, -2.0]])
_DUCT_RADIUS = 3.2


def write_example(path: Path, seed: int) -> None:
    """Write a label map of about a million voxels as NRRD or NIfTI, by the suffix of `path`."""
    package = "nrrd" if path.name.lower().endswith(".nrrd") else "nibabel"
    if find_spec(package) is None:
        raise MissingExtraError(f"example {path}", "meshes", package)
    labels = example_labels(seed)  # (x, y, z)
    scan = np.flip(labels, 2).transpose(0, 2, 1)  # left, posterior, superior
    first = _SCANNER + np.array([_LOW[0], -_LOW[2] - _VOXEL * (labels.shape[2] - 1), _LOW[1]])
    if package == "nrrd":
        _write_nrrd(path, scan, first)
    elif path.name.lower().endswith((".nii", ".nii.gz")):
        affine = np.diag([-_VOXEL, -_VOXEL, _VOXEL, 1.0])
        affine[:3, 3] = first * [-1.0, -1.0, 1.0]
        nibabel: Any = import_module("nibabel")
        image = nibabel.Nifti1Image(scan, affine)
        image.header.set_xyzt_units("mm")
        nibabel.save(image, str(path))
    else:
        raise ScenarioError(f"'{path}' is none of .nrrd, .nii and .nii.gz")


def _write_nrrd(path: Path, scan: NDArray[np.uint8], first: Vector) -> None:
    """Write a map with the names of segments, as 3D Slicer does."""
    header: dict[str, Any] = {
        "space": "left-posterior-superior",
        "kinds": ["domain"] * 3,
        "space directions": _VOXEL * np.eye(3),
        "space origin": first,
        "encoding": "gzip",
    }
    for i, (name, label) in enumerate(LABELS.items()):
        header |= {f"Segment{i}_ID": f"Segment_{i}", f"Segment{i}_Name": name}
        header |= {f"Segment{i}_LabelValue": str(label), f"Segment{i}_Layer": "0"}
    import_module("nrrd").write(str(path), scan, header)


def example_labels(seed: int) -> NDArray[np.uint8]:
    """Return the label of each voxel, shape (x, y, z)."""
    random = np.random.default_rng(seed)
    shape: tuple[int, ...] = tuple(np.rint((_HIGH - _LOW) / _VOXEL).astype(np.int64).tolist())
    points: Vector = _VOXEL * np.moveaxis(np.indices(shape), 0, -1).astype(np.float64) + _LOW
    middle, half = _LIVER
    scaled = np.abs((points - middle) / half)
    outline = (scaled**_BLUNTNESS).sum(axis=-1) ** (1.0 / _BLUNTNESS)
    labels = np.zeros(shape, np.uint8)
    labels[half.min() * (1.0 - outline) + _noise(points, random) > 0.0] = LABELS["liver"]
    duct = np.full(len(_DUCT), _DUCT_RADIUS)
    labels[_along(points, _DUCT, duct) + 0.3 * _noise(points, random) > 0.0] = LABELS["cystic_duct"]
    labels[_along(points, _GALLBLADDER, _RADII) + _noise(points, random) > 0.0] = LABELS["gallbladder"]
    _spoil(labels)
    return labels


def _noise(points: Vector, random: np.random.Generator) -> Vector:
    """Return a sum of waves of 15 to 40 mm, mm."""
    total: Vector = np.zeros(points.shape[:-1])
    for _ in range(_WAVES):
        way = random.normal(size=3)
        way *= 2.0 * np.pi / random.uniform(15.0, 40.0) / np.linalg.norm(way)
        total += np.sin(points @ way + random.uniform(0.0, 2.0 * np.pi))
    return _ROUGHNESS * np.sqrt(2.0 / _WAVES) * total


def _along(points: Vector, line: Vector, radii: Vector) -> Vector:
    """Return the field of a tube along a line of points, with a radius at each, mm."""
    found: Vector = np.full(points.shape[:-1], -np.inf)
    for a, b, first, last in zip(line, line[1:], radii, radii[1:], strict=False):
        way = b - a
        share = np.clip((points - a) @ way / (way @ way), 0.0, 1.0)
        distance = np.linalg.norm(points - a - share[..., None] * way, axis=-1)
        found = np.maximum(found, first + share * (last - first) - distance)
    return found


def _spoil(labels: NDArray[np.uint8]) -> None:
    """Add an island, a hole and a bridge to a blob to the liver."""
    liver, (i, j, k) = LABELS["liver"], np.rint((_LIVER[0] - _LOW) / _VOXEL).astype(np.int64).tolist()
    labels[i - 10 : i - 7, j : j + 2, k : k + 2] = 0
    labels[2:5, 2:5, 2:5] = liver
    column = np.flatnonzero(labels[i - 20, :, k] == liver)
    end = int(column[-1])
    labels[i - 20, end : end + 4, k] = liver
    labels[i - 22 : i - 17, end + 4 : end + 8, k - 2 : k + 3] = liver
