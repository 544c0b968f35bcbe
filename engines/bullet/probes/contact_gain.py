"""The share of a force that Bullet's contacts lose, and the gain that compensates for it.

Where a rigid body touches a face of a soft body at barycentric coordinates w, Bullet spreads the impulse over
the three nodes with weights 2 w / (1 + s), s = w . w, and takes the sum of w times weight as the inverse mass
of the face (btSoftBodyInternals.h, CollideSDF_RDF). Of an impulse J on the rigid body the soft body then
receives only 4 s / (1 + s)^2 J: all of it at a node, 8/9 in the middle of an edge, 3/4 in the middle of a
face. A force on the rigid body must be larger by the inverse for the tissue to feel it whole: by 1 to 4/3.
How several faces share the force of a sphere cannot be read from Bullet; so the gain is measured, from the
elastic forces on the nodes that are touched. See docs/decisions/0015-contact-force.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from engines.bullet.elasticity.forces import Elasticity
from engines.bullet.elasticity.material import Material
from engines.bullet.meshing.tet_mesh import Indices, cross
from engines.bullet.organs.organ import Organ
from engines.bullet.probes.probe import Probe
from schemas.vectors import Vector

__all__ = ["BAND_M", "CONTACT_PERIOD_NS", "Contacts", "Tissue", "closest_points", "touched_faces"]

CONTACT_PERIOD_NS = 8_000_000
"""How often the nodes are read to find where probes touch and what force they receive."""

BAND_M = 6e-4
"""Faces nearer to the sphere than this may share its force; the first guess is that the nearest bears most.
"""

_LARGEST_GAIN = 4.0 / 3.0

_FILTER = 0.2
"""Share of the way to the measured gain gone at each reading: a time constant of 36 ms, in which waves in the
tissue even out.
"""

_LEAST_PART = 1e-3
"""Of a force, on every node of the faces that may be touched."""

_LEAST_FORCE_N = 5e-3
"""Below this the inertia of the touched nodes, of some 0.1 g each, counts in what they receive."""

_NEXT = (1, 2, 0)
"""Corner of a triangle after each."""

_ALL_SIDES = 0b111111
"""The six sides of a box, each a bit."""


class Tissue:
    """An organ as far as contacts go: where it is touched, and what its nodes receive."""

    def __init__(self, organ: Organ, material: Material, gravity: float) -> None:
        """Watch `organ`, in `gravity` (m/s^2) along -z."""
        self.organ = organ
        self._elasticity = Elasticity(organ.mesh, material)
        # Bullet gives all nodes the same mass
        self._node_weight = material.density * organ.mesh.volume / len(organ.mesh.nodes) * gravity
        self._ahead = material.damping / (CONTACT_PERIOD_NS * 1e-9)
        self._before = organ.nodes

    def received(self, nodes: Indices) -> Vector:
        """Return the force (N) with which contacts push these nodes, shape (n, 3), zero for all others.

        It is what balances elasticity, damping and weight. As damping is proportional to stiffness,
        elasticity is taken where the nodes will be a damping time later.
        """
        at = np.zeros(len(self.organ.nodes), dtype=np.bool_)
        at[nodes] = True
        force = -self._elasticity.forces(
            self.organ.nodes + self._ahead * (self.organ.nodes - self._before), at
        )
        force[nodes, 2] += self._node_weight
        return force

    def advance(self) -> None:
        """Keep the present nodes as those before the next ones."""
        self._before = self.organ.nodes


@dataclass(frozen=True)
class _Touch:
    """A sphere near the faces of an organ."""

    probe: Probe
    sphere: int
    distance: float
    """Of its centre from the nearest face, m."""
    guess: float
    """Gain that the faces' distances suggest."""
    nodes: Indices
    """Of these faces, shape (k,)."""
    parts: Vector
    """Of the force, that fall to each of the nodes by the same guess, shape (k,)."""

    @property
    def push(self) -> Vector:
        """Force (N) with which Bullet let it press, shape (3,)."""
        return self.probe.contacts[self.sphere]


class Contacts:
    """Finds which spheres touch organs, and sets their gains."""

    def __init__(self, tissues: Sequence[Tissue]) -> None:
        self._tissues = tissues

    def update(self, probes: Sequence[Probe]) -> None:
        """Correct every gain by what the tissue receives; the organs' nodes have just been read."""
        touches: list[list[_Touch]] = [[] for _ in self._tissues]
        for probe in probes:
            loose = np.flatnonzero(~probe.held)
            found = [_touches(tissue, probe, loose) for tissue in self._tissues]
            for sphere in range(len(probe.radii)):
                here = [(i, touch[sphere]) for i, touch in enumerate(found) if sphere in touch]
                probe.touching[sphere] = bool(here)
                if here:
                    i, touch = min(here, key=lambda item: item[1].distance)
                    touches[i].append(touch)
                else:
                    probe.gains[sphere] = probe.corrections[sphere] = 1.0
        for tissue, here in zip(self._tissues, touches, strict=True):
            if here:
                _correct(tissue, here)
            tissue.advance()


def touched_faces(
    centres: Vector, reach: Vector, nodes: Vector, faces: Indices
) -> tuple[Indices, Indices, Vector, Vector]:
    """Return which spheres touch which faces: all pairs with a distance below the sphere's `reach`.

    A pair is the number of the sphere, shape (p,), and its face, shape (p, 3). Also returned are the
    barycentric coordinates of the faces' nearest points, shape (p, 3), and their distances (m), shape (p,).
    Pairs stand in the order of the spheres, then of the faces.

    Args:
        centres: of the spheres, m, shape (k, 3).
        reach: of each, m, shape (k,).
        nodes: m, shape (n, 3).
        faces: the three nodes of each, shape (f, 3).
    """
    low, high = centres - reach[:, None], centres + reach[:, None]
    close = np.flatnonzero(((nodes.min(axis=0) < high) & (nodes.max(axis=0) > low)).all(axis=1))
    if not close.size:
        return close, np.zeros((0, 3), np.int64), np.zeros((0, 3)), np.zeros(0)
    # A face is near where on each of the six sides of the sphere's box some corner of it is inside.
    inside = np.concatenate([nodes < high[close, None], nodes > low[close, None]], axis=2)  # (c, n, 6)
    sides = np.packbits(inside, axis=2, bitorder="little")[:, :, 0]
    a, b, c = faces.T
    sphere, face = np.nonzero((sides[:, a] | sides[:, b] | sides[:, c]) == _ALL_SIDES)
    sphere, corners = close[sphere], faces[face]
    weights, distance = closest_points(centres[sphere], nodes[corners])
    within = distance < reach[sphere]
    return sphere[within], corners[within], weights[within], distance[within]


def _touches(tissue: Tissue, probe: Probe, loose: Indices) -> dict[int, _Touch]:
    """Return by number, of the spheres `loose`, those that touch the tissue."""
    reach = probe.radii[loose] + BAND_M
    organ = tissue.organ
    pairs, faces, weights, distances = touched_faces(
        probe.positions[loose], reach, organ.nodes, organ.touchable
    )
    starts = np.searchsorted(pairs, np.arange(len(loose) + 1)).tolist()
    return {
        sphere: _touch(probe, sphere, reach[i], faces[start:end], weights[start:end], distances[start:end])
        for i, (sphere, start, end) in enumerate(zip(loose.tolist(), starts[:-1], starts[1:], strict=True))
        if start < end
    }


def _touch(
    probe: Probe, sphere: int, reach: float, faces: Indices, weights: Vector, distance: Vector
) -> _Touch:
    share, s = reach - distance, np.einsum("fi,fi->f", weights, weights)
    guess = float(share @ ((1.0 + s) ** 2 / (4.0 * s)) / share.sum())
    touched, place = np.unique(faces, return_inverse=True)
    parts = np.bincount(place.ravel(), (share[:, None] * weights).ravel()) / share.sum() + _LEAST_PART
    return _Touch(probe, sphere, float(distance.min()), guess, touched, parts)


def _correct(tissue: Tissue, touches: Sequence[_Touch]) -> None:
    """Correct the guesses by what the nodes receive.

    Where spheres share a node, the force on it is divided as the guesses say.
    """
    tied = tissue.organ.anchored | tissue.organ.held
    received = tissue.received(np.unique(np.concatenate([touch.nodes for touch in touches])))
    size = [float(np.linalg.norm(touch.push)) for touch in touches]
    pushed = np.zeros(len(received))
    for touch, force in zip(touches, size, strict=True):
        pushed[touch.nodes] += force * touch.parts
    for touch, force in zip(touches, size, strict=True):
        probe, i = touch.probe, touch.sphere
        if force > _LEAST_FORCE_N and not tied[touch.nodes].any():
            felt = (force * touch.parts / pushed[touch.nodes]) @ received[touch.nodes] @ touch.push / force
            needed = force / max(felt, force / _LARGEST_GAIN)
            probe.corrections[i] += _FILTER * (
                min(max(needed, 1.0), _LARGEST_GAIN) / touch.guess - probe.corrections[i]
            )
        probe.gains[i] = min(max(touch.guess * probe.corrections[i], 1.0), _LARGEST_GAIN)


def closest_points(point: Vector, corners: Vector) -> tuple[Vector, Vector]:
    """Return the points of triangles that are nearest to `point` (m), one for all or one for each.

    They come as barycentric coordinates, shape (f, 3), with their distances (m), shape (f,). The nearest
    point is the foot of the perpendicular if that lies inside the triangle, else it lies on an edge.
    """
    edges = corners.take(_NEXT, axis=1) - corners  # (f, 3, 3): edge k from corner k
    to_point = np.reshape(point, (-1, 1, 3)) - corners  # (f, 3, 3)
    b, c = edges[:, 0], corners[:, 2] - corners[:, 0]  # from corner 0
    normal = cross(b, c)
    square = np.einsum("fi,fi->f", normal, normal)
    on_c = np.einsum("fi,fi->f", cross(b, to_point[:, 0]), normal) / square
    on_b = np.einsum("fi,fi->f", cross(to_point[:, 0], c), normal) / square
    along = np.einsum("fki,fki->fk", to_point, edges) / np.einsum("fki,fki->fk", edges, edges)
    along = np.minimum(np.maximum(along, 0.0), 1.0)
    candidates = np.zeros((4, len(corners), 3))
    candidates[0, :, 0], candidates[0, :, 1], candidates[0, :, 2] = 1.0 - on_b - on_c, on_b, on_c
    for i in range(3):
        candidates[1 + i, :, i], candidates[1 + i, :, _NEXT[i]] = 1.0 - along[:, i], along[:, i]
    away = np.einsum("kfi,fij->kfj", candidates, corners) - point
    distance = np.sqrt((away * away).sum(axis=2))
    distance[0, (candidates[0] < 0.0).any(axis=1)] = np.inf
    best, face = distance.argmin(axis=0), np.arange(len(corners))
    return candidates[best, face], distance[best, face]
