"""A block of tissue."""

from __future__ import annotations

import numpy as np

from engines.bullet.organs.grid import block
from engines.bullet.organs.shape import SIDES, Shape, on_side

__all__ = ["block_shape"]


def block_shape(size: tuple[float, float, float]) -> Shape:
    """Return a block of edge lengths `size` (m)."""
    return Shape(
        description=(
            "a block of the given size along the axes of its frame; the origin is in the middle of its top"
        ),
        mesh=lambda nodes: block(np.array(size), nodes),
        surfaces={side: lambda nodes, side=side: on_side(nodes, side, 0.0) for side in SIDES},
        anchors=("bottom",),
        material=None,
    )
