"""Repairs the voxels of one organ: islands, holes and bridges, as segmentations leave them."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["repair_voxels"]

Mask = NDArray[np.bool_]

_ISLAND = 0.25
"""A part below this share of the largest is an island; one above: the label has several parts."""
_HOLE = 0.05
"""A closed hole below this share of the organ is filled; a larger one is a lumen, and stays."""
_THIN = 0.5
"""Share of voxels with all six neighbours, below which an organ is too thin to tell bridges from itself."""


def repair_voxels(inside: Mask, empty: Mask) -> tuple[Mask, list[str]]:
    """Return the voxels of one body, and the changes.

    Args:
        inside: voxels of the label, shape (i, j, k).
        empty: voxels of no label, which alone may be filled.

    Raises ValueError for a label in several parts.
    """
    ndimage: Any = import_module("scipy.ndimage")
    changes: list[str] = []
    kept = _largest(ndimage, inside, inside, "parts")
    if lost := int(inside.sum() - kept.sum()):
        changes.append(f"{lost} voxels in islands are left out")
    holes: Mask = ndimage.binary_fill_holes(kept) & ~kept & empty
    numbers, count = ndimage.label(holes)
    sizes = np.bincount(numbers.ravel(), minlength=count + 1)
    small = np.flatnonzero(sizes < _HOLE * kept.sum())
    filled: Mask = np.isin(numbers, small[small > 0])
    if filled.any():
        changes.append(f"{int(filled.sum())} voxels in closed holes are filled")
        kept = kept | filled
    core: Mask = ndimage.binary_erosion(kept)
    if core.sum() >= _THIN**3 * kept.sum() and core.any():
        bridged = kept & ~_largest(ndimage, kept, core, "parts joined by bridges of two voxels at most")
        if bridged.any():
            changes.append(f"{int(bridged.sum())} voxels behind thin bridges are left out")
            kept = _largest(ndimage, kept & ~bridged, kept & ~bridged, "parts")
    return kept, changes


def _largest(ndimage: Any, inside: Mask, core: Mask, what: str) -> Mask:
    """Return the voxels of `inside` nearest to the largest part of `core`.

    Raises ValueError if a second part is large.
    """
    numbers, count = ndimage.label(core)
    sizes = np.bincount(numbers.ravel(), minlength=count + 1)
    sizes[0] = 0
    order = np.argsort(-sizes, kind="stable")
    if count > 1 and sizes[order[1]] > _ISLAND * sizes[order[0]]:
        several = int((sizes > _ISLAND * sizes[order[0]]).sum())
        counts = ", ".join(map(str, sizes[order[:several]].tolist()))
        raise ValueError(
            f"it has {several} {what} ({counts} voxels), and an organ is one: give each a label of its own,"
            " or join them, in the program that made the file"
        )
    if count < 2 or inside is core:
        return inside & (numbers == order[0]) if inside is core else inside
    nearest = ndimage.distance_transform_edt(numbers == 0, return_distances=False, return_indices=True)
    return inside & (numbers[tuple(nearest)] == order[0])
