"""Elements of a look: coloured triangle meshes for the eye, primitives for contact. Metres.

Coordinates are in the frame of the look, with every joint at 0: the arm's base frame `<arm>_base` (origin in
the remote centre of motion, insertion along -z) for arms and instruments, the cart's frame for cart and setup
joints.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from schemas.vectors import Vector

__all__ = [
    "BLACK",
    "BLUE",
    "DARK",
    "GREY",
    "IVORY",
    "SLATE",
    "STEEL",
    "Collisions",
    "Looks",
    "Material",
    "Part",
    "Primitive",
]


@dataclass(frozen=True)
class Material:
    """A surface for MuJoCo's shading."""

    name: str
    rgba: tuple[float, float, float, float]
    specular: float = 0.3
    shininess: float = 0.4


IVORY = Material("ivory", (0.898, 0.890, 0.855, 1.0))
"""Material of the covers: the white of the arms in jhu-dvrk/dvrk_model (0.898, 0.918, 0.929), yellowed like
the plastic.
"""
GREY = Material("grey", (0.647, 0.620, 0.588, 1.0))
"""Material of castings and bearings: light grey of the same model."""
DARK = Material("dark", (0.251, 0.251, 0.251, 1.0))
"""Material of joints, rails and motors: dark grey of the same model."""
SLATE = Material("slate", (0.42, 0.45, 0.50, 1.0))
BLACK = Material("black", (0.09, 0.09, 0.10, 1.0), specular=0.5, shininess=0.6)
BLUE = Material("blue", (0.18, 0.34, 0.62, 1.0))
STEEL = Material("steel", (0.76, 0.77, 0.80, 1.0), specular=0.8, shininess=0.7)


@dataclass(frozen=True)
class Part:
    """A closed surface of a material.

    A vertex on a sharp edge is listed once for each adjacent smooth face.
    """

    name: str
    """Name, unique within the look."""
    vertices: Vector
    """Shape (n, 3), m."""
    faces: NDArray[np.int32]
    """Vertex indices, shape (m, 3), counter-clockwise from outside."""
    material: Material


@dataclass(frozen=True)
class Primitive:
    """A convex shape for contact.

    A box with half extents `size`, or a capsule of radius size[0] and half length size[1] along the z axis.
    """

    name: str
    """Name, unique within the look."""
    kind: Literal["box", "capsule"]
    size: tuple[float, ...]
    pose: Vector
    """Shape (4, 4)."""


Looks: TypeAlias = Mapping[str, tuple[Part, ...]]
"""Meshes by body, without the arm's name."""
Collisions: TypeAlias = Mapping[str, tuple[Part | Primitive, ...]]
"""Collision shapes by body, without the arm's name; a part here is convex."""
