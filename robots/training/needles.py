"""Suturing needles: a round wire bent to an arc, with the frames of scenes and rules. SI units.

The frame of a needle is in the centre of the arc, z normal to the plane of the arc, x to the middle of the
wire. The wire is at the angles from -arc/2 (the base with the thread) to +arc/2 (the tip): a positive
rotation about z drives the needle forward. This is the frame of objects of kind `needle`.

Sources: VREP = unina-icaros/dvrk-vrep (commit 88fe597), dVRK-suturing.ttt; SRC =
surgical-robotics-ai/surgical_robotics_challenge, scripts/surgical_robotics_challenge/utils/
coordinate_frames.py and ADF/Needle.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi, radians
from types import MappingProxyType
from typing import Literal

import numpy as np

from schemas.vectors import Vector

__all__ = ["DEFAULT", "NEEDLES", "NeedleName", "NeedleShape"]

NeedleName = Literal["sh", "sh-plus", "src"]
"""A key of `NEEDLES`."""


@dataclass(frozen=True)
class NeedleShape:
    """A round wire bent to an arc of a circle."""

    radius: float
    """Radius of the centre line, m."""
    arc: float
    """Angle from base to tip, rad."""
    wire_radius: float
    """Radius of the cross-section, m."""
    middle: float = 0.0
    """Angle of the frame `mid` in the needle's frame, rad; 0 is half way along the wire."""

    @property
    def length(self) -> float:
        """Along the wire from base to tip, m."""
        return self.radius * self.arc

    def angle(self, behind_tip: float) -> float:
        """Return the angle (rad) in the needle's frame of the point `behind_tip` metres along the wire."""
        return self.arc / 2.0 - behind_tip / self.radius

    def points(self, angles: Vector) -> Vector:
        """Return the points of the centre line at `angles` (rad), m in the needle's frame, shape (n, 3)."""
        return self.radius * np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=-1)

    @property
    def frames(self) -> Mapping[str, Vector]:
        """The frames `base`, `mid` and `tip` in the needle's frame, shape (4, 4): x outwards, y along."""
        angles = {"base": -self.arc / 2.0, "mid": self.middle, "tip": self.arc / 2.0}
        return {name: _frame(self.radius, angle) for name, angle in angles.items()}

    @property
    def bond_points(self) -> Vector:
        """Points of a bond: base, half way and tip, m in the needle's frame, shape (3, 3)."""
        return self.points(np.array([-self.arc / 2.0, 0.0, self.arc / 2.0]))

    @property
    def marks(self) -> Vector:
        """Where `base`, `mid` and `tip` are in the needle's frame, m, shape (3, 3)."""
        return self.points(np.array([-self.arc / 2.0, self.middle, self.arc / 2.0]))


def _frame(radius: float, angle: float) -> Vector:
    frame = np.eye(4)
    frame[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    frame[:3, 3] = frame[:3, 0] * radius
    return frame


_SH = NeedleShape(radius=26e-3 / pi, arc=pi, wire_radius=0.4e-3)
"""A half circle with 26 mm of wire, hence a radius of 8.28 mm: the maker's length of a needle SH, as named in
the authors' paper. Assumed: the wire's radius, taken from `sh-plus`. A catalogue of comparable needles
(itemscatalogue.redcross.int) has 25.9 mm.
"""

_SH_PLUS = NeedleShape(radius=11.44e-3, arc=radians(180.9), wire_radius=0.4e-3)
"""VREP: needle of the authors' scene, 38 % longer than the needle named in the paper."""

_SRC_BASE, _SRC_MID, _SRC_TIP = (-9.513e-3, 1.026e-3), (-4.099e-3, 8.965e-3), (6.618e-3, 6.973e-3)
"""SRC: frames of the needle in the frame of the mesh, m; the tip is on the right in SRC."""


def _needle_through(
    base: tuple[float, float], mid: tuple[float, float], tip: tuple[float, float]
) -> NeedleShape:
    """Return the needle through three points of a plane, m."""
    a, b, c = (np.array(point) for point in (base, mid, tip))
    # the centre is as far from b and c as from a
    centre = np.linalg.solve(2.0 * np.array([b - a, c - a]), np.array([b @ b - a @ a, c @ c - a @ a]))
    first, between, last = (float(np.arctan2(*(point - centre)[::-1])) for point in (a, b, c))
    arc = abs(first - last)
    return NeedleShape(
        radius=float(np.linalg.norm(a - centre)),
        arc=arc,
        wire_radius=0.5e-3,
        middle=abs(first - between) - arc / 2.0,
    )


_SRC = _needle_through(_SRC_BASE, _SRC_MID, _SRC_TIP)
"""SRC: radius 9.39 mm, 132.5 degrees from base to tip, mesh 1.0 mm thick. The mass in SRC, 0.5 kg, would mean
a density of 29 kg/cm^3; our needles are of steel.
"""

NEEDLES: Mapping[NeedleName, NeedleShape] = MappingProxyType({"sh": _SH, "sh-plus": _SH_PLUS, "src": _SRC})
"""The needles by name."""

DEFAULT: NeedleName = "sh-plus"
"""Needle of a scene by default."""
