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
from engines.fem.organ import Organ
from engines.tissue.meshing.tet_mesh import Indices
from engines.tissue.organs.lumen import LumenParams
from schemas.soft_surface import FaceKind
from schemas.vectors import Vector

__all__ = ["Lumen", "opening_flow"]

_CONTRACTION = 0.6
"""Discharge coefficient of a sharp-edged orifice."""
_LEAST_AREA = 1e-10
"""A lumen narrower than 0.01 mm is shut, m^2."""
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

    def __init__(self, params: LumenParams, liquid: Liquid, organ: Organ, rings: Indices) -> None:
        """`rings`: nodes of the inner wall of the uncut mesh, shape (r, a)."""
        self._params, self._liquid, self._organ, self._rings = params, liquid, organ, rings
        n = len(organ.mesh.nodes)
        self._ring_of: NDArray[np.int64] = np.full(n, -1)
        self._sector_of: NDArray[np.int64] = np.full(n, -1)
        r, a = np.indices(rings.shape)
        self._ring_of[rings], self._sector_of[rings] = r, a
        self._station: Vector = (organ.mesh.nodes * self._axis()).sum(axis=1)
        self.shut: NDArray[np.bool_] = np.zeros(len(rings), np.bool_)
        """Rings that a clip has shut, shape (r,)."""
        self._area = float(self.areas(organ.mesh.nodes).mean())
        self._openings: list[_Opening] = []

    def _axis(self) -> Vector:
        middles = self._organ.mesh.nodes[self._rings].mean(axis=1)
        way: Vector = middles[-1] - middles[0]
        return way / np.linalg.norm(way)

    def areas(self, nodes: Vector) -> Vector:
        """Return the cross-section at every ring as of a round tube through its nodes, m^2, shape (r,)."""
        points = nodes[self._rings]
        arms = points - points.mean(axis=1, keepdims=True)
        spans = np.cross(arms, np.roll(arms, -1, axis=1)).sum(axis=1)
        turn = 2.0 * pi / self._rings.shape[1]
        return 0.5 * turn / sin(turn) * np.linalg.norm(spans, axis=1)

    def nearest(self, point: Vector) -> tuple[int, Vector]:
        """Return the ring nearest to a point (m, in `world`), and the way from the point to its middle, m."""
        ways = self._organ.nodes[self._rings].mean(axis=1) - point
        ring = int(np.linalg.norm(ways, axis=1).argmin())
        return ring, ways[ring]

    def shut_rings(self, ring: int, closing: Vector, width: float) -> NDArray[np.int32]:
        """Shut the rings within half a width (m) of a ring.

        Return the pairs of nodes of opposite walls, shape (p, 2), which meet along the direction `closing`.
        """
        points = self._organ.nodes[self._rings]
        middles = points.mean(axis=1)
        shut = np.flatnonzero(np.linalg.norm(middles - middles[ring], axis=1) <= 0.5 * width)
        shut = shut[~self.shut[shut]]
        self.shut[shut] = True
        half = len(self._rings[0]) // 2
        most = (half - 1) // 2
        above = np.array(range(-most, most + 1), np.int64)
        pairs = [np.zeros((0, 2), np.int64)]
        for here in shut.tolist():
            first = int(((points[here] - middles[here]) * closing).sum(axis=1).argmax())
            sectors = np.stack([first + above, first + half - above], axis=1) % (2 * half)
            pairs.append(self._rings[here][sectors])
        return np.concatenate(pairs).astype(np.int32)

    def find_openings(self) -> None:
        """Find where the inner wall is open, in a mesh that has been cut."""
        surface, solid = self._organ.surface, self._organ.solid
        slots = np.flatnonzero((surface.kinds != FaceKind.OUTSIDE) & (surface.faces[:, 0] >= 0))
        slots = slots[slots >= len(self._organ.mesh.triangles)]
        origins = solid.origin[surface.faces[slots]]
        ring, sector = self._opened_edges(origins)
        crosses, is_open = sector >= 0, ring >= 0
        opened = np.zeros(self._rings.shape, np.bool_)
        opened[ring[crosses], sector[crosses]] = True
        marks = np.zeros(len(self._rings), np.bool_)
        marks[ring[is_open]] = True
        elements = self._station[solid.origin[solid.tetrahedra[solid.owners[slots]]]].mean(axis=1)
        is_left = elements < self._station[origins].mean(axis=1)
        self._openings = []
        for first, last in _runs(marks):
            sectors = int(opened[first : last + 1].any(axis=0).sum())
            here = ((ring >= first) & (ring <= last)).any(axis=1)
            share = max(1, sectors) / self._rings.shape[1]
            self._openings.append(_Opening(first, last, share, slots[here], is_left[here]))

    def _opened_edges(self, origins: NDArray[np.int32]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return lower ring and sector of each edge of faces, shapes (k, 3).

        The ring is -1 for an edge that is not open on the inner wall, the sector for an edge along the tube
        too. An edge is open if one of its nodes has parted: else the crack ends there. `origins`: nodes of
        the faces in the uncut mesh, shape (k, 3).
        """
        edges = origins[:, _EDGES]  # (k, 3, 2)
        rings, sectors = self._ring_of[edges], self._sector_of[edges]
        parted = np.bincount(self._organ.solid.origin, minlength=len(self._ring_of)) > 1
        is_open = (rings >= 0).all(axis=2) & (np.abs(rings[..., 0] - rings[..., 1]) <= 1)
        is_open &= parted[edges].any(axis=2)
        apart = np.abs(sectors[..., 0] - sectors[..., 1])
        sector: NDArray[np.int64] = sectors.min(axis=2)
        sector[apart > 1] = len(self._rings[0]) - 1
        return np.where(is_open, rings.min(axis=2), -1), np.where(is_open & (apart > 0), sector, -1)

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
