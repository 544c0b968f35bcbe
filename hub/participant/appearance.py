"""How a page may draw a session as an endoscope sees it: textures, coats of metal and plastic, surroundings.

A kind offers an appearance by an entry point of the group `trocar.appearances`: a function with the
participant's validated parameters (`Params`) and the soft bodies at rest, by name, as arguments, and an
`Appearance` as result.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from schemas.soft_surface import FaceKind

__all__ = ["Appearance", "Coat", "RestBody", "Skin", "Surrounding", "Texture"]


class RestBody(NamedTuple):
    """A soft body at the start of a session."""

    nodes: NDArray[np.float32]
    """Shape (n, 3), m, frame `world`."""
    faces: NDArray[np.uint32]
    """Node indices of the surface, shape (f, 3), counter-clockwise from outside."""


class Texture(NamedTuple):
    """Three pictures in files of type JPEG; their first row is at v = 0."""

    colour: bytes
    """sRGB."""
    normal: bytes
    """Normal in the tangent frame."""
    roughness: bytes
    """Grey: 0 is a mirror, 255 chalk."""


class Coat(NamedTuple):
    """A texture that repeats, laid onto a surface from the sides of a box."""

    texture: Texture
    tile_m: float
    """Side of a tile, m."""
    metal: float
    """Share of metal."""


class Skin(NamedTuple):
    """The outside of a soft body, unfolded into a picture."""

    texture: Texture
    uv: NDArray[np.float32]
    """Texture coordinates of the corners of each face, shape (f, 3, 2)."""
    charts: NDArray[np.uint16]
    """Chart of each face, shape (f,): coordinates jump from chart to chart."""


class Surrounding(NamedTuple):
    """A mesh that stands still around the scene and is seen from one side."""

    vertices: NDArray[np.float32]
    """Shape (n, 3), m, frame `world`."""
    faces: NDArray[np.uint32]
    """Vertex indices, shape (f, 3), counter-clockwise from the visible side."""
    uv: NDArray[np.float32]
    """Texture coordinates, shape (n, 2)."""
    texture: Texture


class Appearance(NamedTuple):
    """The appearance of a session."""

    skins: Mapping[str, Skin]
    """Skins of soft bodies, by name."""
    kinds: Mapping[FaceKind, Coat]
    """Coats of changed faces of soft bodies."""
    coats: Mapping[str, Coat]
    """Coats of rigid parts, by `Part.coat`."""
    surroundings: Sequence[Surrounding]
    place: str
    """Name of the place, which says how it is lit: `abdomen`, `subhepatic`, `dry-lab`, `none`."""
    vignette: float = 0.0
    """Share of light that the lens of the endoscope loses in the corners of a picture."""
