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
from engines.fem.blood.partings import Parting, find_partings, without_crumbs
from engines.fem.organ import Organ
from engines.tissue.organs.inner_wall import InnerWall
from engines.tissue.organs.lumen import LumenParams
from robots.vector3 import cross
from schemas.soft_surface import FaceKind
from schemas.vectors import Vector

__all__ = ["Lumen", "Opening", "opening_flow"]

_CONTRACTION = 0.6
"""Discharge coefficient of a sharp-edged orifice."""
_LEAST_AREA = 1e-10
"""A lumen narrower than 0.01 mm is shut, m^2."""
_NARROWEST_GAP_M = 3e-4
"""Width of a slit in a sac whose sides touch: the pressure of the liquid opens it; assumed."""
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
class Opening:
    """A run of neighbouring rings between which the inner wall is open."""

    first: int
    last: int
    share: float
    """Open part of the circumference; 1: the tube is parted."""
    hole: float
    """Area of the inner wall that has gone, m^2."""
    parted: NDArray[np.int64]
    """Nodes of the inner wall that have parted, each with one of their copies, shape (p, 2)."""
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
        self._ragged: dict[int, NDArray[np.integer]] = {}
        """Rings with nodes in crumbs: their other nodes."""
        arms = np.linalg.norm(points - points.mean(axis=1, keepdims=True), axis=2)
        self.walls: Vector = 0.5 * self.diameters - arms.mean(axis=1)
        """Thickness of the wall at each ring, m, shape (r,)."""
        self._area = float(self.areas(organ.mesh.nodes).mean())
        self._cell = 0.5 * (float(np.diff(self.along).mean()) + sqrt(4.0 * pi * self._area) / len(points[0]))
        """Mean distance of neighbouring nodes of the inner wall, m."""
        self.left: Vector = np.array([params.volume or params.reserve or 0.0])
        """Liquid left in a sac, or in the reserve at the left end, m^3."""
        self.openings: list[Opening] = []
        self.partings: list[Parting] = []
        """Places where the tube is parted, from the left end to the right."""

    def areas(self, nodes: Vector) -> Vector:
        """Return the cross-section at every ring as of a round tube through its nodes, m^2, shape (r,).

        A ring with crumbs has no outline, and the mean cross-section at rest.
        """
        points = nodes[self._rings]
        arms = points - points.mean(axis=1, keepdims=True)
        spans = np.cross(arms, np.roll(arms, -1, axis=1)).sum(axis=1)
        turn = 2.0 * pi / self._rings.shape[1]
        found: Vector = 0.5 * turn / sin(turn) * np.linalg.norm(spans, axis=1)
        for ring in self._ragged:
            found[ring] = self._area
        return found

    @property
    def spilled(self) -> Vector | None:
        """Liquid that a sac has lost, ml, shape (1,); None: no sac."""
        return None if self._params.volume is None else 1e6 * (self._params.volume - self.left)

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
        return self._middles_of(self._organ.nodes)

    def _middles_of(self, nodes: Vector) -> Vector:
        """Return the middles of the rings without their crumbs, m, shape (r, 3)."""
        found: Vector = nodes[self._rings].mean(axis=1)
        for ring, kept in self._ragged.items():
            found[ring] = nodes[kept].mean(axis=0)
        return found

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
        surface, solid, whole = self._organ.surface, self._organ.solid, len(self._organ.mesh.triangles)
        slots = np.flatnonzero((surface.kinds != FaceKind.OUTSIDE) & (surface.faces[:, 0] >= 0))
        slots = slots[slots >= whole]
        origins = solid.origin[surface.faces[slots]]
        gone = self._organ.mesh.triangles[surface.faces[:whole, 0] < 0]
        gone = gone[(self._ring_of[gone] >= 0).all(axis=1)]
        parted: NDArray[np.bool_] = np.bincount(solid.origin, minlength=len(self._ring_of)) > 1
        ring, sector, width = self._opened_edges(origins, parted)
        burnt, burnt_sector, burnt_width = self._opened_edges(gone, np.ones(len(parted), np.bool_))
        opened = self._opened_sectors(
            *(np.concatenate(pair) for pair in ((ring, burnt), (sector, burnt_sector), (width, burnt_width)))
        )
        marks = np.zeros(len(self._rings), np.bool_)
        marks[ring[ring >= 0]] = True
        marks[burnt[burnt >= 0]] = True
        elements = self._station[solid.origin[solid.tetrahedra[solid.owners[slots]]]].mean(axis=1)
        is_left = elements < self._station[origins].mean(axis=1)
        areas = self._areas_of(gone)
        pieces = self._ring_pieces()
        self.openings, self.partings = [], find_partings(pieces, self.along)
        kept = without_crumbs(pieces)
        some = np.flatnonzero(kept.any(axis=1) & ~kept.all(axis=1)).tolist()
        self._ragged = {ring: self._rings[ring, kept[ring]] for ring in some}
        for first, last in _runs(marks):
            sectors = int(opened[first : last + 1].any(axis=0).sum())
            here = ((ring >= first) & (ring <= last)).any(axis=1)
            lost = ((burnt >= first) & (burnt <= last)).any(axis=1)
            here |= np.isin(origins, gone[lost]).any(axis=1)
            share = max(1, sectors) / self._rings.shape[1]
            pairs = self._parted_nodes(origins[here], parted)
            hole = float(areas[lost].sum())
            self.openings.append(Opening(first, last, share, hole, pairs, slots[here], is_left[here]))

    def _opened_sectors(
        self, ring: NDArray[np.int64], sector: NDArray[np.int64], width: NDArray[np.int64]
    ) -> NDArray[np.bool_]:
        """Return the sectors over which edges pass, shape (r, a)."""
        crosses, opened = sector >= 0, np.zeros(self._rings.shape, np.bool_)
        for step in range(int(width.max(initial=0))):  # an edge may pass over sectors
            passes = crosses & (width > step)
            opened[ring[passes], (sector[passes] + step) % self._rings.shape[1]] = True
        return opened

    def _areas_of(self, faces: NDArray[np.integer]) -> Vector:
        """Return the areas of faces of the uncut mesh, m^2."""
        corners = self._organ.mesh.nodes[faces]
        return 0.5 * np.linalg.norm(
            np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
        )

    def _parted_nodes(self, faces: NDArray[np.int32], parted: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Return each parted node of the inner wall at these faces with its last copy, shape (p, 2)."""
        nodes = np.unique(faces)
        nodes = nodes[parted[nodes] & (self._ring_of[nodes] >= 0)]
        last: NDArray[np.int64] = np.full(len(parted), -1)
        last[self._organ.solid.origin] = np.arange(len(self._organ.solid.origin))
        return np.stack([nodes, last[nodes]], axis=1).astype(np.int64)

    def gape(self, opening: Opening, nodes: Vector) -> float:
        """Return the area of an opening of a sac, m^2: a hole, or the width of a slit along its length."""
        if opening.share >= 1.0:
            return self._area
        one, other = (nodes[opening.parted[:, k]] for k in (0, 1))
        widths = np.maximum(np.linalg.norm(one - other, axis=1), _NARROWEST_GAP_M)
        return min(self._area, opening.hole + self._cell * float(widths.sum()))

    def _ring_pieces(self) -> NDArray[np.int64]:
        """Return the piece of the organ to which each node of the rings belongs, -1: none, shape (r, a)."""
        solid, pieces = self._organ.solid, self._organ.solid.pieces
        piece_of: NDArray[np.int64] = np.full(len(solid.origin), -1)
        present = pieces >= 0
        piece_of[solid.tetrahedra[present]] = pieces[present, None]
        return piece_of[self._rings]

    def _opened_edges(
        self, origins: NDArray[np.integer], parted: NDArray[np.bool_]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """Return lower ring, first sector and number of sectors of each edge of faces, shapes (k, 3).

        The ring is -1 for an edge that is not open on the inner wall, the sector for an edge along the tube
        too. An edge is open if one of its nodes has parted: else the crack ends there.

        origins: nodes of the faces in the uncut mesh, shape (k, 3). parted: by node of the uncut mesh.
        """
        edges = origins[:, _EDGES]  # (k, 3, 2)
        rings, sectors = self._ring_of[edges], self._sector_of[edges]
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

    def velocity(self, nodes: Vector, seconds: float) -> Vector:
        """Return the flow per area out of each face of the surface, m/s, shape (f,), for `seconds`."""
        found: Vector = np.zeros(len(self._organ.surface.faces))
        if not self.openings:
            return found
        if self._params.volume is not None:
            self._empty(found, self._params.volume, nodes, seconds)
            return found
        resistance = self._resistances(nodes)
        for end in self._params.supply:
            for opening in self.openings if end == "left" else self.openings[::-1]:
                # nodes of a parted ring stay with the left part
                behind = resistance[: opening.first] if end == "left" else resistance[opening.last + 1 :]
                self._supply(found, opening, behind, end, nodes, seconds)
                if opening.share >= 1.0:
                    break
        return found

    def _supply(
        self, found: Vector, opening: Opening, behind: Vector, end: str, nodes: Vector, seconds: float
    ) -> None:
        """Let out of an opening what comes from an end through the resistances `behind`."""
        side = end if opening.share >= 1.0 else ""
        reserve = self._params.reserve if end == "left" else None
        if reserve is None:
            self._pour(found, opening, self._flow(opening, behind), side, nodes)
            return
        left = float(self.left[0])
        flow = min(self._flow(opening, behind, left / reserve), left / seconds)
        if flow > 0.0 and self._pour(found, opening, flow, side, nodes):
            self.left[0] = max(0.0, left - flow * seconds)

    def _empty(self, found: Vector, volume: float, nodes: Vector, seconds: float) -> None:
        """Let a sac run out through its openings, by a pressure that falls with what is left."""
        pressure = self._params.pressure * float(self.left[0]) / volume
        for opening in self.openings:
            flow = opening_flow(pressure, self.gape(opening, nodes), 0.0, self._liquid.density)
            flow = min(flow, float(self.left[0]) / seconds, self._params.most_flow or np.inf)
            if flow > 0.0 and self._pour(found, opening, flow, "", nodes):
                self.left[0] = max(0.0, float(self.left[0]) - flow * seconds)

    def _flow(self, opening: Opening, resistances: Vector, full: float = 1.0) -> float:
        """Return the flow out of an opening behind resistances, m^3/s. `full`: share of the pressure."""
        area, density = opening.share * self._area, self._liquid.density
        flow = opening_flow(full * self._params.pressure, area, float(resistances.sum()), density)
        return flow if self._params.most_flow is None else min(flow, self._params.most_flow)

    def _pour(self, found: Vector, opening: Opening, flow: float, side: str, nodes: Vector) -> bool:
        """Spread a flow over the open faces of an opening; of a parted tube those of one side.

        Return whether there are any.
        """
        slots = opening.slots
        if side:
            slots = slots[opening.is_left == (side == "left")]
        if not opening.hole or opening.share >= 1.0:
            slots = slots[self._organ.surface.kinds[slots] == FaceKind.CUT]  # a sealed stump is tight
        a, b, c = (nodes[self._organ.surface.faces[slots, i]] for i in range(3))
        area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
        whole = float(area.sum())
        if whole > 0.0:
            found[slots] = np.maximum(found[slots], flow / whole)
        return whole > 0.0

    def _resistances(self, nodes: Vector) -> Vector:
        """Return the resistance between each ring and the next, Pa s/m^3, shape (r - 1,); infinite: shut."""
        areas = self.areas(nodes)
        shut = self.shut | (areas < _LEAST_AREA)
        middles = self._middles_of(nodes)
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
