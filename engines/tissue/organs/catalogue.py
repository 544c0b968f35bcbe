"""The organs for scenarios, and the block of tissue of any size."""

from __future__ import annotations

import numpy as np

from engines.tissue.meshing.grid import block
from engines.tissue.organs.colon import COLON
from engines.tissue.organs.kidney import KIDNEY_WITH_ADRENAL
from engines.tissue.organs.liver import LIVER_LOBE
from engines.tissue.organs.shape import SIDES, Shape, on_side

__all__ = ["SHAPES", "block_shape"]

SHAPES = {"kidney-with-adrenal": KIDNEY_WITH_ADRENAL, "colon": COLON, "liver-lobe": LIVER_LOBE}


def block_shape(
    size: tuple[float, float, float], layers: tuple[float, ...] = (), rows: tuple[int | None, ...] = ()
) -> Shape:
    """Return a block of edge lengths `size` (m), with layers of these thicknesses (m) from the top down.

    `rows`: of cells of each layer, where they are stated.
    """
    return Shape(
        description=(
            "a block of the given size along the axes of its frame; the origin is in the middle of its top"
        ),
        mesh=lambda nodes: block(np.array(size), nodes, layers, rows),
        surfaces={side: lambda nodes, side=side: on_side(nodes, side, 0.0) for side in SIDES},
        anchors=("bottom",),
        material=None,
    )
