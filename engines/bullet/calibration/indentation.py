"""The force of an indenter on tissue without time to relax."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Literal, get_args

import numpy as np

from engines.tissue.elasticity.half_space import DEEPEST, sphere_force
from engines.tissue.material import Material
from schemas.errors import RecordingError
from schemas.vectors import Vector

__all__ = ["SHAPES", "Indenter", "Shape", "elastic_force"]

Shape = Literal["sphere", "punch"]
SHAPES: tuple[Shape, ...] = get_args(Shape)
"""A sphere, and a flat round punch."""

_TABOR = 0.2
"""Representative strain over contact radius over sphere radius (Tabor, The Hardness of Metals, 1951)."""
_NO_DENSITY = 0.0
"""Nothing moves of itself here."""
_LARGEST_CONTACT = 0.5
"""Largest contact radius over thickness for a force on a layer within 3 % of finite elements
(docs/decisions/0073-calibrated-tissue.md).
"""


@dataclass(frozen=True)
class Indenter:
    """Indenter and pressed sample; m."""

    shape: Shape
    radius: float
    thickness: float | None = None
    """Thickness of the layer, bonded to a rigid base; None: as good as infinite."""
    poisson_ratio: float = 0.4

    def check(self, depth: Vector) -> None:
        """Raise RecordingError where no law here holds for presses as deep as `depth` (m)."""
        deepest = float(depth.max())
        if self.shape == "punch" and self.thickness is not None:
            raise RecordingError(
                "a thickness is known for a sphere only: leave it out, or press with a sphere"
            )
        if self.shape == "sphere" and deepest > DEEPEST * self.radius:
            raise RecordingError(
                f"depths up to {deepest * 1e3:.3g} mm, allowed up to {DEEPEST:g} radii,"
                f" {DEEPEST * self.radius * 1e3:.3g} mm: leave deeper samples out"
            )
        contact = np.sqrt(self.radius * max(deepest, 0.0))
        if self.thickness is not None and contact > _LARGEST_CONTACT * self.thickness:
            raise RecordingError(
                f"the layer of {self.thickness * 1e3:.3g} mm is too thin for a contact of radius"
                f" {contact * 1e3:.3g} mm, at most {_LARGEST_CONTACT:g} of it is allowed: press less deep, or"
                " with a smaller sphere"
            )


def elastic_force(indenter: Indenter, depth: Vector, young_modulus: float, stiffening: float) -> Vector:
    """Return the force (N) at `depth` (m, below the unloaded surface), any shape.

    For a sphere a neo-Hookean half-space, for a punch a linear half-space (Johnson, Contact Mechanics, 1985,
    section 3.4). `stiffening` b multiplies the force of a sphere by exp(b (l^2 + 2/l - 3)) with the
    representative stretch l = 1 - 0.2 a / R, a^2 = R d: the stiffening of an indented Fung material (Lin et
    al., Biomech. Model. Mechanobiol. 8, 2009, 345). 0 is neo-Hookean.
    """
    pressed = np.maximum(depth, 0.0)
    radius, nu = indenter.radius, indenter.poisson_ratio
    if indenter.shape == "punch":
        return 2.0 * young_modulus * radius / (1.0 - nu**2) * pressed
    force = sphere_force(pressed, radius, Material(young_modulus, nu, _NO_DENSITY, damping=0.0))
    contact = np.sqrt(radius * pressed)
    if indenter.thickness is not None:
        force = force * _of_layer(contact / indenter.thickness, nu)
    stretch = 1.0 - _TABOR * contact / radius
    return force * np.exp(stiffening * (stretch**2 + 2.0 / stretch - 3.0))


def _of_layer(ratio: Vector, poisson_ratio: float) -> Vector:
    """Return the factor on the force of a bonded layer; `ratio`: contact radius over thickness.

    Dimitriadis et al., Biophys. J. 82 (2002), 2798: a series for spheres and a linear layer.
    """
    nu = poisson_ratio
    a = -(1.2876 - 1.4678 * nu + 1.3442 * nu**2) / (1.0 - nu)
    b = (0.6387 - 1.0277 * nu + 1.5164 * nu**2) / (1.0 - nu)
    terms = [
        1.0,
        -2.0 * a / pi,
        4.0 * a**2 / pi**2,
        -8.0 / pi**3 * (a**3 + 4.0 * pi**2 / 15.0 * b),
        16.0 * a / pi**4 * (a**3 + 3.0 * pi**2 / 5.0 * b),
    ]
    return np.polynomial.Polynomial(terms)(ratio)
