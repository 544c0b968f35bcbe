"""One organ of a label map: its voxels, repaired, and their smooth field."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from engines.tissue.files.label_file import LabelMap
from engines.tissue.meshing.label_field import LabelField
from engines.tissue.meshing.label_repair import repair_voxels
from engines.tissue.meshing.mesh_check import LARGEST_M, SMALLEST_M
from schemas.vectors import Vector

__all__ = ["LabelBody", "cut_out"]

_FEWEST_VOXELS = 30


@dataclass(frozen=True)
class LabelBody:
    """Voxels of an organ."""

    name: str
    label: int
    inside: NDArray[np.bool_]
    """Whether a voxel is of the organ, in its part of the map, shape (i, j, k)."""
    affine: Vector
    """Map of the voxel numbers of this part to metres, shape (3, 4)."""
    changes: list[str]
    """Sentences: what was repaired."""

    @cached_property
    def field(self) -> LabelField:
        """The smooth field."""
        return LabelField(self.inside, self.affine)

    @cached_property
    def boundary(self) -> Vector:
        """Middles of faces between voxels inside and outside, m, shape (b, 3)."""
        padded, points = np.pad(self.inside, 1).astype(np.int8), list[Vector]()
        for axis in range(3):
            step = np.zeros(3)
            step[axis] = 0.5
            points.append(np.argwhere(np.diff(padded, axis=axis)) - 1.0 + step)
        return np.concatenate(points) @ self.affine[:, :3].T + self.affine[:, 3]


def cut_out(found: LabelMap, name: str, label: int) -> LabelBody:
    """Return an organ of a map, repaired. Raises ValueError, naming the organ, for voxels that are none."""
    inside = found.labels == label
    places = np.argwhere(inside)
    if len(places) < _FEWEST_VOXELS:
        raise ValueError(
            f"{name} (label {label}) has {len(places)} voxels; {_FEWEST_VOXELS} are needed at least"
        )
    low, high = places.min(axis=0), places.max(axis=0) + 1
    size = float(((high - low) * found.spacing).max())
    if not SMALLEST_M <= size <= LARGEST_M:
        raise ValueError(
            f"{name} is {1e3 * size:.4g} mm large, which is no organ ({1e3 * SMALLEST_M:g} to"
            f" {1e3 * LARGEST_M:g} mm): state the file's --unit"
        )
    part = tuple(slice(int(a), int(b)) for a, b in zip(low, high, strict=True))
    try:
        repaired, changes = repair_voxels(inside[part], found.labels[part] == 0)
    except ValueError as error:
        raise ValueError(f"{name} (label {label}): {error}") from error
    ends = found.ends & np.array([low == 0, high == np.array(found.labels.shape)])
    if ends.any():
        changes.append("it is cut off where the scan ends")
    corner = found.affine[:, 3] + found.affine[:, :3] @ low
    return LabelBody(name, label, repaired, np.column_stack([found.affine[:, :3], corner]), changes)
