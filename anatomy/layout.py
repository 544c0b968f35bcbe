"""The centre lines of a patient's tubes in `world`: x to the patient's left, y cranial, z anterior.

The origin lies in the middle of Calot's triangle. By eye, after pictures of the operation; only lengths and
diameters are the patient's.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from anatomy.patient import HEPATIC_ARTERY_DIAMETER, Patient
from anatomy.rounding import round_corners

__all__ = ["Layout", "Line"]

Line = NDArray[np.float64]
"""Points of a centre line, m, shape (k, 3)."""

_NECK_WALL = 0.0021
"""Wall of the gallbladder where the cystic duct begins, m."""
_MOST_WALL = 0.3
"""Largest wall of the gallbladder over its outer diameter: a narrow infundibulum keeps a lumen."""
_LEAST_STONE = 0.008
"""Least width of a stone in the neck, m; assumed."""
_CONFLUENCE_Y = -0.014
_COMMON = np.array(
    [[0.020, -0.050, -0.010], [0.0205, -0.028, -0.007], [0.020, -0.008, -0.007], [0.019, 0.012, -0.009]]
)
"""Common bile duct and common hepatic duct, caudal to cranial, below their last point."""
_HILUM = np.array([[0.0195, 0.024, -0.0125], [0.0195, 0.032, -0.016]])
_SLACK = 0.95
"""Distance of the ends of the cystic duct over its length, before it is pulled."""
_EMBEDDED = 0.0004
"""How far an end lies inside the wall that it joins, m."""
_DUCT_WAY = np.array([-0.82, 0.48, 0.32])
"""Direction of the cystic duct from the common bile duct to the gallbladder."""
_MEDIAL = np.array([0.9, 0.3, -0.25])
"""Side of the infundibulum where a straight cystic artery ends."""
_ROOM, _ROOM_MADE = 0.0015, 0.004
"""Gap between the cystic duct and an artery that crosses it, as grown and dissected, m."""
_LIFT, _LIFT_MADE = 0.004, 0.009
"""How far such an artery leads off the gallbladder, as grown and dissected, m."""
_TOWARDS = np.array([0.008, 0.022, -0.010])
"""Place near which a straight cystic artery leaves the right hepatic artery."""
_FARTHEST_LEFT = 0.0115
"""Left limit of this place beside a short duct, m."""
_LOW = {"front": np.array([0.007, -0.024, -0.0105]), "behind": np.array([0.007, -0.024, -0.0165])}
"""Place from which an artery comes that crosses the cystic duct; farther right beside a long duct."""
_BEHIND_COMMON = 0.0062
"""Gap between the common hepatic duct and the corner of the right hepatic artery behind it, m."""


def _unit(vector: Line) -> Line:
    return vector / np.linalg.norm(vector)


@dataclass(frozen=True)
class Layout:
    """Centre lines of a patient."""

    patient: Patient
    is_dissected: bool = True
    """Whether the tubes lie apart, as after the dissection of the triangle."""

    @cached_property
    def common_duct(self) -> Line:
        """Common bile duct and common hepatic duct, caudal end first."""
        return np.concatenate([_COMMON, _HILUM])

    @cached_property
    def confluence(self) -> Line:
        """Where the cystic duct ends, inside the wall of the common bile duct, shape (3,)."""
        radius = 0.5 * self.patient.common_duct_diameter
        return self._common_at(_CONFLUENCE_Y) + _unit(_DUCT_WAY) * (radius - _EMBEDDED)

    @cached_property
    def neck(self) -> Line:
        """Where the gallbladder ends and the cystic duct begins, shape (3,)."""
        return self.confluence + _unit(_DUCT_WAY) * _SLACK * self.patient.duct_length

    @cached_property
    def cystic_duct(self) -> Line:
        """From the neck to the common bile duct, in a shallow bow."""
        start, end, length = self.neck, self.confluence, self.patient.duct_length
        bow = _unit(np.array([-0.35, -0.75, 0.55])) * 0.10 * length
        shares = np.array([0.0, 0.12, 0.35, 0.65, 0.88, 1.0])
        weights = np.array([0.0, 0.2, 0.8, 0.8, 0.2, 0.0])
        return start + shares[:, None] * (end - start) + weights[:, None] * bow

    @cached_property
    def gallbladder(self) -> Line:
        """From the neck over infundibulum and body to the fundus."""
        length = self.patient.gallbladder_length
        beside = np.array([0.0, -4.5, -10.5, -16.0, -18.0, -18.0, -16.0]) * 1e-3
        along = np.array([0.0, 0.045, 0.12, 0.28, 0.50, 0.72, 0.90]) * length
        above = np.array([0.0, 1.0, 3.0, 4.5, 4.5, 5.0, 6.5]) * 1e-3
        return self.neck + np.stack([beside, along, above], axis=1)

    @cached_property
    def gallbladder_diameters(self) -> Line:
        """Outer diameter at each point of the gallbladder's line, m."""
        shares = np.array([0.0, 0.42, 0.68, 0.86, 1.0, 1.0, 0.94])
        found = shares * self.patient.gallbladder_width
        found[0] = self.patient.duct_diameter + 0.0025
        return found

    @cached_property
    def gallbladder_walls(self) -> Line:
        """Thickness of the wall at each point of the gallbladder's line, m."""
        wall = self.patient.gallbladder_wall
        found = np.minimum(wall, _MOST_WALL * self.gallbladder_diameters)
        found[0] = min(wall, _NECK_WALL)
        return found

    @cached_property
    def stone(self) -> tuple[Line, Line, float]:
        """Lower end of a stone in the neck, direction of its line, and width of the lumen there, m."""
        line, lumens = self.gallbladder[:5], (self.gallbladder_diameters - 2.0 * self.gallbladder_walls)[:5]
        legs: Line = np.linalg.norm(np.diff(line, axis=0), axis=1)
        along: Line = np.append(0.0, np.cumsum(legs))
        low = max(0.5 * float(along[1] + along[2]), float(np.interp(_LEAST_STONE, lumens, along)))
        places = np.array([low, low + _LEAST_STONE])
        end, above = np.stack([np.interp(places, along, line[:, axis]) for axis in range(3)], axis=1)
        return end, _unit(above - end), float(np.interp(low, along, lumens))

    def _on_infundibulum(self, outward: Line) -> tuple[Line, Line]:
        """Return a place on the wall of the infundibulum in a direction, and the normal there."""
        low, high = self.gallbladder[1:3]
        shares = np.array([0.7, 0.3])
        radius = 0.5 * float((self.gallbladder_diameters[1:3] * shares).sum())
        along = _unit(high - low)
        normal = _unit(outward - float((outward * along).sum()) * along)
        return shares[0] * low + shares[1] * high + normal * (radius - _EMBEDDED), normal

    @cached_property
    def cystic_artery(self) -> Line:
        """From the gallbladder to the right hepatic artery, straight or across the cystic duct."""
        return self._straight_artery if self.patient.artery == "cranial" else self._crossing_artery

    @property
    def _straight_artery(self) -> Line:
        (start, outward), length = self._on_infundibulum(_MEDIAL), self.patient.artery_length
        towards = _TOWARDS.copy()
        towards[0] = min(max(start[0] + 0.003, _TOWARDS[0]), _FARTHEST_LEFT)
        way = _unit(towards - start)
        end, leg = start + way * _SLACK * length, 0.3 * length
        off = start + _unit(outward + 0.3 * way) * leg
        return round_corners(np.stack([start, off, end - way * leg, end]))

    @property
    def _crossing_artery(self) -> Line:
        """From the gallbladder in front of the cystic duct, or behind it, and down."""
        side, low = (1.0 if self.patient.artery == "front" else -1.0), _LOW[self.patient.artery]
        room, lift = (_ROOM_MADE, _LIFT_MADE) if self.is_dissected else (_ROOM, _LIFT)
        start, outward = self._on_infundibulum(np.array([0.4, -0.2, 0.9 * side]))
        along = _unit(self.confluence - self.neck)
        across = _unit(np.array([0.0, 0.0, side]) - side * along[2] * along)
        apart = 0.5 * (self.patient.duct_diameter + self.patient.artery_diameter) + 1.8 * room
        crossing = self.cystic_duct[2] + across * apart  # the rounded line passes nearer than its corner
        off = start + _unit(outward + _unit(crossing - start)) * lift
        end = np.array([min(crossing[0] + 0.002, low[0]), low[1], low[2]])
        share = 0.65 + 0.1 * side
        before = np.array([end[0], end[1] + 0.009, share * crossing[2] + (1.0 - share) * end[2]])
        return round_corners(np.stack([start, off, crossing, before, end]))

    @cached_property
    def hepatic_artery(self) -> Line:
        """The right hepatic artery, behind the common hepatic duct or, ascending, behind the bile duct."""
        line, is_cranial = self.cystic_artery, self.patient.artery == "cranial"
        over = line[-1] + _unit(line[-1] - line[-2]) * (0.5 * HEPATIC_ARTERY_DIAMETER - _EMBEDDED)
        behind = self._common_at(float(over[1]) - 0.008)
        behind[0] -= 0.005 * is_cranial
        behind[2] -= 0.5 * (self.patient.common_duct_diameter + HEPATIC_ARTERY_DIAMETER) + _BEHIND_COMMON
        left = behind + np.array([0.016, -0.006, 0.002])
        onwards = over + np.array([-0.003, 0.012, -0.004] if is_cranial else [-0.012, 0.005, -0.003])
        half = _unit(onwards - behind) * 0.004  # of a leg, in whose middle is the joint
        return round_corners(np.stack([left, behind, over - half, over + half, onwards]))

    def _common_at(self, y: float) -> Line:
        """Return the middle of the common bile duct or common hepatic duct at a height, m, shape (3,)."""
        line = self.common_duct
        return np.array([np.interp(y, line[:, 1], line[:, axis]) for axis in range(3)])
