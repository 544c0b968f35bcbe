"""The jaw of scissors: two edges that pass each other. SI units, radians."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from robots.dvrk.end_effectors.contact_sphere import JAW_ROOT, ContactSphere
from robots.dvrk.end_effectors.jaw import FINGERS, Jaw
from schemas.vectors import Vector

__all__ = ["CURVE", "Scissors"]

CURVE = 0.0028
"""Distance of the end of curved blades from the middle, along the hinge, m: that of Maryland jaws as drawn
(`engines.mujoco.looks.fingers`); no public model states it.
"""
_BLADE_RADIUS = 0.0008
"""Radius of the spheres at the ends of an edge, m: half the thickness of a blade, assumed."""
_HUB_RADIUS, _HUB_PLACE = 0.0020, 0.0020
"""Radius of the sphere of the hub, m, and its distance from the middle, along the hinge: within the bounds of
jaw meshes in med-air/SurRoL.
"""


@dataclass(frozen=True)
class Scissors(Jaw):
    """A jaw whose fingers are blades."""

    curve: float = 0.0
    """Distance of the end of a blade from the middle, along the hinge, m."""

    edges: ClassVar[tuple[tuple[int, int], tuple[int, int]]] = ((0, 1), (2, 3))
    """Spheres at root and end of the left and of the right edge."""
    hinge: ClassVar[int] = 4
    """Sphere on the hinge, on the side from where the left edge closes clockwise."""

    def spheres(self, tip: Vector, /) -> tuple[ContactSphere, ...]:
        """Return the spheres at the ends of both edges, which meet in the closed jaw, and that of the hub."""
        ahead, axis = tip[:3, 2], np.array([0.0, 0.0, 1.0])
        spheres: list[ContactSphere] = []
        for finger, turn in zip(FINGERS, (np.eye(3), np.diag([1.0, -1.0, -1.0])), strict=True):
            for name, way in (("root", JAW_ROOT), ("end", self.length)):
                place = way * ahead + self.curve * (way / self.length) ** 2 * axis
                x, y, z = (turn @ place).tolist()
                spheres.append(ContactSphere(f"{finger}_{name}", finger, (x, y, z), _BLADE_RADIUS))
        hub = ContactSphere("hub", FINGERS[0], (0.0, 0.0, _HUB_PLACE), _HUB_RADIUS)
        return *spheres, hub
