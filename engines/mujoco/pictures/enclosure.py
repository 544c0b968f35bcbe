"""Whether a camera is inside a soft body."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from engines.mujoco.pictures.soft_body import SoftBody
from schemas.vectors import Vector

__all__ = ["enclosing_bodies"]


def enclosing_bodies(point: Vector, bodies: Mapping[str, SoftBody]) -> Iterator[str]:
    """Yield the names of soft bodies with `point` inside their surface; `point`: shape (3,), m, `world`."""
    for name, body in bodies.items():
        if not len(body.nodes):
            continue
        if (point < body.nodes.min(axis=0)).any() or (point > body.nodes.max(axis=0)).any():
            continue
        faces = body.surface.faces
        if _solid_angle(body.nodes[faces[faces[:, 0] >= 0]] - point) > 2.0 * np.pi:
            yield name


def _solid_angle(corners: Vector) -> float:
    """Return the solid angle of triangles, shape (f, 3, 3), around the origin; 4 pi inside a closed surface.

    Van Oosterom and Strackee, IEEE Transactions on Biomedical Engineering 30 (1983) 125.
    """
    a, b, c = corners.astype(np.float64).transpose(1, 0, 2)
    far_a, far_b, far_c = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    volume = (a * np.cross(b, c)).sum(axis=1)
    shares = far_a * far_b * far_c
    shares += (a * b).sum(axis=1) * far_c + (b * c).sum(axis=1) * far_a + (c * a).sum(axis=1) * far_b
    return float(2.0 * np.arctan2(volume, shares).sum())
