"""Rigid boxes as `_rigid.c` reads them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from engines.tissue.organs.anchors import RigidParams
from robots import rotation
from schemas.vectors import Vector

__all__ = ["NO_BOXES", "box_rows"]

_COLUMNS = 16

NO_BOXES: Vector = np.zeros((0, _COLUMNS))


def box_rows(parts: Iterable[RigidParams]) -> Vector:
    """Return middle (m, in `world`), rotation row by row, half edges (m) and friction, shape (b, 16)."""
    rows = [
        (
            *part.position,
            *rotation.matrix(np.array(part.orientation)).ravel().tolist(),
            *(0.5 * edge for edge in part.box),
            part.friction,
        )
        for part in parts
    ]
    return np.array(rows, np.float64).reshape(-1, _COLUMNS)
