"""Edges of burns inside of cuts: ragged coats from one kind of tissue to the next.

Faces are coagulated or charred as a whole, and so are the triangles of a picture. A vertex between kinds has
a share of each; a coat is opaque where share and noise are above a limit.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np
from mujoco import mjrf
from numpy.typing import NDArray

from engines.mujoco.pictures.filament.drawn_coat import DrawnCoat
from engines.mujoco.textures.noise import SEED, Noise
from engines.mujoco.textures.surface import Pixels, smooth_step
from schemas.soft_surface import FaceKind
from schemas.vectors import Vector

__all__ = ["DrawnBurns", "burnt_shares", "mostly"]

_COLOURS: Mapping[FaceKind, tuple[float, float, float]] = {
    FaceKind.COAGULATED: (0.78, 0.66, 0.52),
    FaceKind.CHARRED: (0.12, 0.085, 0.07),
}
"""Mean colours of the recipes."""
_EDGES: Mapping[FaceKind, tuple[float, float]] = {
    FaceKind.COAGULATED: (0.25, 0.65),
    FaceKind.CHARRED: (0.42, 0.58),
}
"""Shares at which a coat begins to be seen, and is opaque."""
_LIFTS: Mapping[FaceKind, float] = {FaceKind.COAGULATED: 3e-5, FaceKind.CHARRED: 6e-5}
"""Distances from the faces, m."""
_ROUGHNESS = 0.6
_PIXELS, _ROWS, _PERIOD = 64, 256, 0.02
"""Texels over the share, texels over a way in space, and the length of this way until it repeats, m."""
_NOTCH, _RAGGED = 0.8e-3, 0.3
"""Size of a notch of an edge, m, and the share over which notches reach."""
_WAY = np.array([0.62, 0.71, 0.33], np.float32)


class DrawnBurns:
    """Coats over one mesh of a soft body, which stay as they are until the surface changes."""

    def __init__(
        self,
        context: mjrf.Context,
        scene: mjrf.Scene,
        faces: NDArray[np.uint32],
        rest: Vector,
        shares: Mapping[FaceKind, Vector],
        is_inner: NDArray[np.bool_],
    ) -> None:
        """Prepare coats.

        Args:
            context: the renderer's.
            scene: where they are drawn.
            faces: drawn vertices of each face, shape (m, 3).
            rest: drawn vertices at rest, shape (n, 3), m.
            shares: of inner faces of each kind, or burnt more, around each drawn vertex, shape (n,).
            is_inner: which faces are inside of cuts, shape (m,).
        """
        way = (rest.astype(np.float32) @ _WAY) / np.float32(_PERIOD)
        self._coats: list[tuple[DrawnCoat, NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_]]] = []
        for kind, share in shares.items():
            around = share[faces]
            is_edge: NDArray[np.bool_] = is_inner & (around > 0.0).any(axis=1) & (around < 1.0).any(axis=1)
            if is_edge.any():
                coat = DrawnCoat(context, scene, faces, _edge(kind), _ROUGHNESS)
                uv = np.stack([0.01 + 0.98 * share.astype(np.float32), way], axis=1)
                self._coats.append((coat, uv, np.full(len(share), _LIFTS[kind], np.float32), is_edge))

    def update(self, vertices: NDArray[np.float32]) -> None:
        """Move the coats; `vertices`: as drawn, with tangent frames, shape (n, 9)."""
        for coat, uv, lift, is_edge in self._coats:
            coat.show(vertices, uv, lift, is_edge)

    def hide(self) -> None:
        """Show no coats."""
        for coat, *_ in self._coats:
            coat.hide()


def burnt_shares(
    faces: NDArray[np.int64], kinds: NDArray[np.uint8], count: int
) -> dict[FaceKind, NDArray[np.float64]]:
    """Return the share of faces of each burnt kind, or burnt more, around each of `count` nodes.

    Args:
        faces: node indices, shape (f, 3).
        kinds: `FaceKind` of each, shape (f,).
        count: of nodes.
    """
    around = np.maximum(np.bincount(faces.ravel(), minlength=count), 1)
    return {
        kind: np.bincount(faces[kinds >= kind].ravel(), minlength=count) / around
        for kind in (FaceKind.COAGULATED, FaceKind.CHARRED)
    }


def mostly(shares: Mapping[FaceKind, Vector], faces: NDArray[np.int64]) -> NDArray[np.uint8]:
    """Return the kind of tissue below the coats of inner faces, node indices of shape (f, 3)."""
    kinds = np.full(len(faces), FaceKind.CUT, np.uint8)
    for kind, share in shares.items():
        kinds[(share[faces] >= 1.0).all(axis=1)] = kind
    return kinds


@cache
def _edge(kind: FaceKind) -> Pixels:
    """Return colours and opacities over share and way, shape (256, 64, 4); the way repeats."""
    turn = 2.0 * np.pi * np.arange(_ROWS) / _ROWS
    radius = _PERIOD / (2.0 * np.pi)
    ring = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.zeros(_ROWS)], axis=1)
    notches = Noise(SEED).octaves(ring.astype(np.float32), _NOTCH, 7 + kind, 3)[:, None]
    share = np.linspace(0.0, 1.0, _PIXELS, dtype=np.float32)[None]
    ragged = share + np.float32(4.0 * _RAGGED) * share * (1.0 - share) * notches
    found = np.empty((_ROWS, _PIXELS, 4), np.float32)
    found[..., :3] = np.array(_COLOURS[kind], np.float32) * (1.0 + 0.06 * notches[..., None])
    found[..., 3] = smooth_step(ragged.ravel(), *_EDGES[kind]).reshape(ragged.shape)
    return np.rint(255.0 * np.clip(found, 0.0, 1.0)).astype(np.uint8)
