"""A page's view of a participant: bodies with meshes, moved by outputs, and soft surfaces.

A kind offers a view by an entry point of the group `trocar.scenes`: a function or class with the
participant's validated parameters (`Params`) as argument and a `Scene` as result.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from schemas.soft_surface import FaceKind
from schemas.vectors import Vector

__all__ = ["TISSUE_COLOURS", "Camera", "Frame", "Part", "Rgb", "Scene", "Tint", "tint_of", "wet_colours"]

Rgb = tuple[float, float, float]
"""Red, green and blue, each from 0 to 1."""

TISSUE_COLOURS: Mapping[FaceKind, Rgb] = {
    FaceKind.CUT: (0.70, 0.06, 0.07),
    FaceKind.COAGULATED: (0.84, 0.76, 0.64),
    FaceKind.CHARRED: (0.11, 0.07, 0.05),
}
"""Colours of changed tissue, by eye: raw and wet in a cut, pale where coagulated, black where charred."""


class Tint(NamedTuple):
    """Colour of a liquid by its thickness."""

    deep: Rgb
    """Colour of a deep pool."""
    depth_m: Rgb
    """Thickness that lets a share 1/e of the light of red, green and blue through, m."""


_TINTS: Mapping[str, Tint] = {
    "blood": Tint((0.30, 0.012, 0.015), (90e-6, 60e-6, 50e-6)),
    "bile": Tint((0.33, 0.30, 0.03), (2e-3, 1.5e-3, 0.2e-3)),
}
"""Tints by eye: thin blood is red, as it lets red light through, thick blood is dark.

The absorption of haemoglobin alone would let the red of a camera through some 400 um: so drawn, the edge of
a cut glows.
"""


def tint_of(liquid: str) -> Tint:
    """Return the tint of a liquid; of an unknown one that of blood."""
    return _TINTS.get(liquid, _TINTS["blood"])


def wet_colours(colour: Rgb, thickness_m: Vector, liquid: str) -> Vector:
    """Return the colours, shape (n, 3), of a surface of `colour` under films, shape (n,), of a liquid."""
    tint = tint_of(liquid)
    through: Vector = np.exp(-thickness_m[:, None] / np.array(tint.depth_m))
    return through * np.array(colour) + (1.0 - through) * np.array(tint.deep)


class Part(NamedTuple):
    """A mesh of a single colour on a body."""

    body: int
    """Index of the body."""
    colour: tuple[float, float, float, float]
    """Red, green, blue and opacity, each from 0 to 1."""
    vertices: NDArray[np.float32]
    """Shape (n, 3), m, in the frame of the body."""
    faces: NDArray[np.uint32]
    """Vertex indices, shape (f, 3), counter-clockwise from outside."""
    coat: str = ""
    """Name of the material, such as `steel`."""


class Frame(NamedTuple):
    """A frame worth showing, such as the frame of a tip."""

    name: str
    body: int
    pose: Sequence[float]
    """Pose in the body: position (m) and quaternion (x, y, z, w)."""


class Camera(NamedTuple):
    """A camera on a body, looking along the camera's own z with y down."""

    name: str
    body: int
    pose: Sequence[float]
    """Pose of the optical frame in the body: position (m) and quaternion (x, y, z, w)."""
    field_of_view: float
    """Horizontal, rad."""
    baseline: float
    """Distance of the two eyes, m, each half of the distance along x from the centre; 0: a single eye."""


class Scene(Protocol):
    """The bodies of a participant and their poses."""

    @property
    def bodies(self) -> Sequence[str]:
        """Names of the bodies."""
        ...

    @property
    def parts(self) -> Sequence[Part]:
        """The meshes; bodies do not change theirs."""
        ...

    @property
    def frames(self) -> Sequence[Frame]:
        """The frames worth showing."""
        ...

    @property
    def cameras(self) -> Sequence[Camera]:
        """The cameras of the participant itself."""
        ...

    @property
    def surfaces(self) -> Mapping[str, Rgb]:
        """The colour of each output of type `trocar_msgs/msg/SoftBodyState`."""
        ...

    @property
    def inputs(self) -> Sequence[str]:
        """The outputs of the participant needed by `poses`; empty if nothing moves."""
        ...

    def poses(self, values: Mapping[str, Vector]) -> NDArray[np.float32]:
        """Return the pose of each body in the world, shape (bodies, 7): m and quaternion (x, y, z, w).

        `values`: the newest value of each of `inputs`. Raises MessageError for another shape.
        """
        ...
