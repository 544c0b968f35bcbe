"""Reads label maps of strangers: which voxel belongs to which organ."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engines.tissue.files.foreign_file import parse_file
from engines.tissue.files.label_parser import LABEL_SUFFIXES
from schemas.vectors import Vector

__all__ = ["LABEL_SUFFIXES", "LabelMap", "is_label_map", "read_labels"]

_TO_WORLD = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""Left, posterior, superior to the axes of an operation: left, cranial, anterior (up, on the back)."""

_MOST_SHEAR = 0.3
"""Cosine between two axes of voxels: gantries tilt by up to 15 degrees."""


@dataclass(frozen=True)
class LabelMap:
    """Voxels of organs, the box around them."""

    labels: NDArray[np.uint16]
    """Label of each voxel, 0 outside, shape (i, j, k)."""
    affine: Vector
    """Map of voxel numbers (middles) to x left, y cranial, z anterior, m, shape (3, 4)."""
    ends: NDArray[np.bool_]
    """Whether the box ends where the file does, at the low and the high end of each axis, shape (2, 3)."""
    names: dict[str, int]
    """Labels by name, as the file has them."""
    notes: list[str]
    """Sentences: what was assumed."""

    @property
    def spacing(self) -> Vector:
        """Edges of a voxel, m, shape (3,)."""
        return np.linalg.norm(self.affine[:, :3], axis=0)


def is_label_map(path: Path) -> bool:
    """Return whether a file is read as a label map, by its name."""
    return path.name.lower().endswith(LABEL_SUFFIXES)


def read_labels(path: Path, unit: float | None = None) -> LabelMap:
    """Return the label map of a file. `unit`: m; None: as the file states.

    Raises ValueError, naming the file.
    """
    package = "nrrd" if path.name.lower().endswith(".nrrd") else "nibabel"
    arrays: dict[str, NDArray[Any]] = parse_file(
        path, "engines.tissue.files.label_parser", (package, "scipy")
    )
    affine: Vector = (unit or float(arrays["metres"])) * (_TO_WORLD @ arrays["affine"])
    found = LabelMap(
        arrays["labels"].astype(np.uint16),
        affine,
        arrays["ends"],
        json.loads(str(arrays["names"])),
        json.loads(str(arrays["notes"])),
    )
    axes = affine[:, :3] / np.maximum(found.spacing, 1e-30)
    if found.spacing.min() < 1e-6 or np.abs(axes.T @ axes - np.eye(3)).max() > _MOST_SHEAR:
        raise ValueError(
            f"mesh {path}: voxels with edges of {(1e3 * found.spacing).tolist()} mm along {axes.T.tolist()}"
            " are too small or too oblique"
        )
    return found
