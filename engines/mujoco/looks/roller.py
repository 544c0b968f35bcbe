"""The pads of a roller: their meshes, and their boxes for contact.

They are drawn like fingers (`engines.mujoco.looks.fingers`), at the middle of their travel.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from engines.mujoco.looks.part import DARK, Part, Primitive
from engines.mujoco.looks.solids import block, part, placed
from robots.dvrk.rolling_needle_driver import PADS, Roller
from schemas.vectors import Vector

__all__ = ["boxes", "parts"]


def parts(roller: Roller, pose: Vector) -> dict[str, tuple[Part, ...]]:
    """Return the meshes of the pads by body, drawn in the frame `pose`, shape (4, 4)."""
    solids = {
        name: block(tuple((centre - half).tolist()), tuple((centre + half).tolist()))
        for name, centre, half in _pads(roller)
    }
    return {
        name: (part(name, placed(solid, pose[:3, :3], pose[:3, 3]), DARK),) for name, solid in solids.items()
    }


def boxes(roller: Roller, pose: Vector) -> Iterator[tuple[str, Primitive]]:
    """Yield body and box of each pad: its face lies in the plane x = 0."""
    for name, centre, half in _pads(roller):
        box = pose.copy()
        box[:3, 3] += pose[:3, :3] @ centre
        yield name, Primitive(name, "box", tuple(half.tolist()), box)


def _pads(roller: Roller) -> Iterator[tuple[str, Vector, Vector]]:
    """Yield name, centre and half extents (m) of each pad."""
    along, across, thickness = roller.size
    for name, side in zip(PADS, (1, -1), strict=True):
        yield (
            name,
            np.array([side * thickness / 2.0, 0.0, roller.distance]),
            np.array([thickness, across, along]) / 2.0,
        )
