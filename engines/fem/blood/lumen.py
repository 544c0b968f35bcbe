"""The lumen of a tube: where it is open, and how much flows out there.

An opening lets out the flow for which the pressure is the sum of the losses: of the jet, as of a sharp-edged
orifice (Bernoulli), and along the tube from its supply (Poiseuille, with the present cross-sections).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from engines.fem.blood.film import Liquid
from engines.fem.blood.partings import Parting, find_partings
from engines.fem.organ import Organ
from engines.tissue.organs.inner_wall import InnerWall
from engines.tissue.organs.lumen import LumenParams
from robots.vector3 import cross
from schemas.soft_surface import FaceKind
from schemas.vectors import Vector

__all__ = ["Lumen", "opening_flow"]

_CONTRACTION = 0.6
"""Discharge coefficient of a sharp-edged orifice."""
_LEAST_AREA = 1e-10
"""A lumen narrower than 0.01 mm is shut, m^2."""
_BESIDE = 3
"""Rings on each side of a clip between which its tube has a direction."""
_EDGES = np.array([[0, 1], [1, 2], [2, 0]])


def opening_flow(pressure: float, area: float, resistance: float, density: float) -> float:
    """Return the flow (m^3/s) out of an opening of `area` (m^2) behind a `resistance` (Pa s/m^3)."""
    if area <= 0.0 or pressure <= 0.0 or not np.isfinite(resistance):
        return 0.0
    jet = 0.5 * density / (_CONTRACTION * area) ** 2
    return 2.0 * pressure / (resistance + sqrt(resistance * resistance + 4.0 * jet * pressure))


@dataclass(frozen=True)
class _Opening:
    """A run of neighbouring rings between which the inner wall is open."""

    first: int
    last: int
    share: float
    """Open part of the circumference; 1: the tube is parted."""
    slots: NDArray[np.int64]
    """Faces around the opening, shape (k,)."""
    is_left: NDArray[np.bool_]
    """Whether each belongs to the part towards the left end, shape (k,)."""


class Lumen:
    """The inner wall as rings of nodes, from the left end to the right."""

    def __init__(self, params: LumenParams, liquid: Liquid, organ: Organ, wall: InnerWall) -> None:
        """`wall`: the inner wall of the uncut mesh."""
        self._params, self._liquid, self._organ = params, liquid, organ
        self._rings, self._ring_of, self._sector_of = wall.rings, wall.ring_of, wall.sector_of
        self._station, self.diameters = wall.stations, wall.diameters
        along = wall.stations[wall.rings].mean(axis=1)
        self.along: Vector = along - along[0]
        """Distance of each ring from the first along the line at rest, m, shape (r,)."""
        self.shut: NDArray[np.bool_] = np.zeros(len(self._rings), np.bool_)
        """Rings that a clip has shut, shape (r,)."""
        points = organ.mesh.nodes[self._rings]
        arms = np.linalg.norm(points - points.mean(axis=1, keepdims=True), axis=2)
        self.walls: Vector = 0.5 * self.diameters - arms.mean(axis=1)
        """Thickness of the wall at each ring, m, shape (r,)."""
        self._area = float(self.areas(organ.mesh.nodes).mean())
        self._openings: list[_Opening] = []
        self.partings: list[Parting] = []
        """Places where the tube is parted, from the left end to the right."""

    def areas(self, nodes: Vector) -> Vector:
        """Return the cross-section at every ring as of a round tube through its nodes, m^2, shape (r,)."""
        points = nodes[self._rings]
        arms = points - points.mean(axis=1, keepdims=True)
        spans = np.cross(arms, np.roll(arms, -1, axis=1)).sum(axis=1)
        turn = 2.0 * pi / self._rings.shape[1]
        return 0.5 * turn / sin(turn) * np.linalg.norm(spans, axis=1)

    @property
    def open_areas(self) -> Vector:
        """Present cross-section at every ring, 0 where a clip shuts it, m^2, shape (r,)."""
        return np.where(self.shut, 0.0, self.areas(self._organ.nodes))

    def nearest(self, point: Vector) -> tuple[int, Vector]:
        """Return the ring nearest to a point (m, in `world`), and the way from the point to its middle, m."""
        ways = self.middles - point
        ring = int(np.linalg.norm(ways, axis=1).argmin())
        return ring, ways[ring]

    def rings_near(self, ring: int, reach: float) -> tuple[int, int]:
        """Return the first and the last ring whose middles are within `reach` (m) of that of a ring."""
        middles = self.middles
        near = np.flatnonzero(np.linalg.norm(middles - middles[ring], axis=1) <= reach)
        return int(near[0]), int(near[-1])

    def sector_towards(self, ring: int, direction: Vector) -> int:
        """Return the sector of a ring that lies farthest along a direction."""
        points = self._organ.nodes[self._rings[ring]]
        return int(((points - points.mean(axis=0)) * direction).sum(axis=1).argmax())

    def opposite(self, ring: int, sector: int) -> NDArray[np.int32]:
        """Return pairs of nodes of opposite walls that meet where a sector is pressed, shape (p, 2)."""
        half = self._rings.shape[1] // 2
        most = (half - 1) // 2
        above = np.array(range(-most, most + 1), np.int64)
        sectors = np.stack([sector + above, sector + half - above], axis=1) % (2 * half)
        pairs = self._rings[ring][sectors]
        return pairs[pairs[:, 0] != pairs[:, 1]].astype(np.int32)

    @property
    def middles(self) -> Vector:
        """Middle of every ring now, m, in `world`, shape (r, 3)."""
        return self._organ.nodes[self._rings].mean(axis=1)

    def direction(self, ring: int) -> Vector:
        """Return the direction of the tube at a ring, a unit vector, shape (3,)."""
        middles = self.middles
        along: Vector = middles[min(ring + _BESIDE, len(middles) - 1)] - middles[max(ring - _BESIDE, 0)]
        return along / max(float(np.linalg.norm(along)), 1e-12)

    def frame_at(self, ring: int, sector: int) -> Vector:
        """Return the axes of a flattened ring: across the tube, along the tube, and where its walls meet.

        `sector`: the pressed one. Shape (3, 3), a column each.
        """
        quarter, along = self._rings.shape[1] // 4, self.direction(ring)
        one, other = self._organ.nodes[self._rings[ring, [sector - quarter, sector - 3 * quarter]]]
        across: Vector = one - other - float((along * (one - other)).sum()) * along
        across /= max(float(np.linalg.norm(across)), 1e-12)
        return np.column_stack([across, along, cross(across, along)])

    def find_openings(self) -> None:
        """Find where the inner wall is open, in a mesh that has been cut."""
        surface, solid = self._organ.surface, self._organ.solid
        slots = np.flatnonzero((surface.kinds != FaceKind.OUTSIDE) & (surface.faces[:, 0] >= 0))
        slots = slots[slots >= len(self._organ.mesh.triangles)]
        origins = solid.origin[surface.faces[slots]]
        ring, sector, width = self._opened_edges(origins)
        crosses, is_open = sector >= 0, ring >= 0
        opened = np.zeros(self._rings.shape, np.bool_)
        for step in range(int(width.max(initial=0))):  # an edge may pass over sectors
            passes = crosses & (width > step)
            opened[ring[passes], (sector[passes] + step) % self._rings.shape[1]] = True
        marks = np.zeros(len(self._rings), np.bool_)
        marks[ring[is_open]] = True
        elements = self._station[solid.origin[solid.tetrahedra[solid.owners[slots]]]].mean(axis=1)
        is_left = elements < self._station[origins].mean(axis=1)
        self._openings, self.partings = [], find_partings(self._ring_pieces(), self.along)
        for first, last in _runs(marks):
            sectors = int(opened[first : last + 1].any(axis=0).sum())
            here = ((ring >= first) & (ring <= last)).any(axis=1)
            share = max(1, sectors) / self._rings.shape[1]
            self._openings.append(_Opening(first, last, share, slots[here], is_left[here]))

    def _ring_pieces(self) -> NDArray[np.int64]:
        """Return the piece of the organ to which each node of the rings belongs, -1: none, shape (r, a)."""
        solid, pieces = self._organ.solid, self._organ.solid.pieces
        piece_of: NDArray[np.int64] = np.full(len(solid.origin), -1)
        present = pieces >= 0
        piece_of[solid.tetrahedra[present]] = pieces[present, None]
        return piece_of[self._rings]

    def _opened_edges(
        self, origins: NDArray[np.int32]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """Return lower ring, first sector and number of sectors of each edge of faces, shapes (k, 3).

        The ring is -1 for an edge that is not open on the inner wall, the sector for an edge along the tube
        too. An edge is open if one of its nodes has parted: else the crack ends there. `origins`: nodes of
        the faces in the uncut mesh, shape (k, 3).
        """
        edges = origins[:, _EDGES]  # (k, 3, 2)
        rings, sectors = self._ring_of[edges], self._sector_of[edges]
        parted = np.bincount(self._organ.solid.origin, minlength=len(self._ring_of)) > 1
        is_open = (rings >= 0).all(axis=2) & (np.abs(rings[..., 0] - rings[..., 1]) <= 1)
        is_open &= parted[edges].any(axis=2)
        around = self._rings.shape[1]
        apart = np.abs(sectors[..., 0] - sectors[..., 1])
        wraps = apart > around // 2
        highest, lowest = sectors.max(axis=2), sectors.min(axis=2)
        sector = np.asarray(np.where(wraps, highest, lowest), np.int64)
        width = np.where(wraps, around - apart, apart)
        ring = np.where(is_open, rings.min(axis=2), -1)
        return ring, np.where(is_open & (apart > 0), sector, -1), width

    def velocity(self, nodes: Vector) -> Vector:
        """Return the flow per area out of each face of the surface, m/s, shape (f,)."""
        found: Vector = np.zeros(len(self._organ.surface.faces))
        if not self._openings:
            return found
        resistance = self._resistances(nodes)
        for end in self._params.supply:
            for opening in self._openings if end == "left" else self._openings[::-1]:
                # nodes of a parted ring stay with the left part
                behind = resistance[: opening.first] if end == "left" else resistance[opening.last + 1 :]
                is_parted = opening.share >= 1.0
                self._pour(found, opening, self._flow(opening, behind), end if is_parted else "", nodes)
                if is_parted:
                    break
        return found

    def _flow(self, opening: _Opening, resistances: Vector) -> float:
        """Return the flow out of an opening behind these resistances, m^3/s."""
        area, density = opening.share * self._area, self._liquid.density
        flow = opening_flow(self._params.pressure, area, float(resistances.sum()), density)
        return flow if self._params.most_flow is None else min(flow, self._params.most_flow)

    def _pour(self, found: Vector, opening: _Opening, flow: float, side: str, nodes: Vector) -> None:
        """Spread a flow over the open faces of an opening; of a parted tube those of one side."""
        slots = opening.slots
        if side:
            slots = slots[opening.is_left == (side == "left")]
        slots = slots[self._organ.surface.kinds[slots] == FaceKind.CUT]  # a sealed stump is tight
        a, b, c = (nodes[self._organ.surface.faces[slots, i]] for i in range(3))
        area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
        whole = float(area.sum())
        if whole > 0.0:
            found[slots] = np.maximum(found[slots], flow / whole)

    def _resistances(self, nodes: Vector) -> Vector:
        """Return the resistance between each ring and the next, Pa s/m^3, shape (r - 1,); infinite: shut."""
        areas = self.areas(nodes)
        shut = self.shut | (areas < _LEAST_AREA)
        middles = nodes[self._rings].mean(axis=1)
        lengths = np.linalg.norm(np.diff(middles, axis=0), axis=1)
        mean = np.maximum(np.minimum(areas[1:], areas[:-1]), _LEAST_AREA)
        found = 8.0 * pi * self._liquid.viscosity * lengths / (mean * mean)
        return np.where(shut[1:] | shut[:-1], np.inf, found)


def _runs(marks: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return first and last place of every run of marks."""
    padded = np.concatenate([[False], marks, [False]]).astype(np.int8)
    steps = np.diff(padded)
    return list(
        zip(np.flatnonzero(steps == 1).tolist(), (np.flatnonzero(steps == -1) - 1).tolist(), strict=True)
    )
