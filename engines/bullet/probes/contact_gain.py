"""The loss of force in Bullet's contacts, and the compensating gain.

Where a rigid body touches a face of a soft body at barycentric coordinates w, Bullet spreads the impulse over
the three nodes with weights 2 w / (1 + s), s = w . w, and takes the sum of w times weight as the inverse mass
of the face (btSoftBodyInternals.h, CollideSDF_RDF). From an impulse J on the rigid body the soft body then
receives only 4 s / (1 + s)^2 J: all at a node, 8/9 in the middle of an edge, 3/4 in the middle of a face. A
force on the rigid body must be larger by the inverse, 1 to 4/3, for the tissue to receive the whole force.
The division of a sphere's force among several faces cannot be read from Bullet; so the gain is measured, from
the elastic forces on the touched nodes. See docs/decisions/0015-contact-force.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from engines.bullet.elasticity.forces import Elasticity
from engines.bullet.organ import Organ
from engines.bullet.probes.probe import Probe
from engines.tissue.material import Material
from engines.tissue.meshing.tet_mesh import Indices
from engines.tissue.probes.near_faces import BAND_M, CONTACT_PERIOD_NS, NearFaces, near_faces
from schemas.vectors import Vector

__all__ = ["Contacts", "Tissue"]

_LARGEST_GAIN = 4.0 / 3.0

_FILTER = 0.2
"""Fraction of the way to the measured gain at each reading: a time constant of 36 ms, in which waves in the
tissue even out.
"""

_LEAST_PART = 1e-3
"""Least part of a force on every node of possibly touched faces."""

_LEAST_FORCE_N = 5e-3
"""Least force for a correction: below, the inertia of the touched nodes (some 0.1 g each) matters."""


class Tissue:
    """An organ for contacts: touched places, and forces on the nodes."""

    def __init__(self, organ: Organ, material: Material, gravity: float) -> None:
        """Watch `organ`, in `gravity` (m/s^2) along -z."""
        self.organ = organ
        self._elasticity = Elasticity(organ.mesh, material)
        # Bullet gives all nodes the same mass
        self._node_weight = material.density * organ.mesh.volume / len(organ.mesh.nodes) * gravity
        self._ahead = material.damping / (CONTACT_PERIOD_NS * 1e-9)
        self._before = organ.nodes

    def received(self, nodes: Indices) -> Vector:
        """Return the contact force (N) on these nodes, shape (n, 3), zero elsewhere.

        The contact force balances elasticity, damping and weight. As damping is proportional to stiffness,
        elasticity is evaluated at the nodes' places a damping time later.
        """
        at = np.zeros(len(self.organ.nodes), dtype=np.bool_)
        at[nodes] = True
        force = -self._elasticity.forces(
            self.organ.nodes + self._ahead * (self.organ.nodes - self._before), at
        )
        force[nodes, 2] += self._node_weight
        return force

    def advance(self) -> None:
        """Store the present nodes as the previous nodes."""
        self._before = self.organ.nodes


@dataclass(frozen=True)
class _Touch:
    """A sphere near the faces of an organ."""

    probe: Probe
    sphere: int
    distance: float
    """Distance of the centre from the nearest face, m."""
    guess: float
    """Gain from the faces' distances."""
    nodes: Indices
    """Nodes of the faces, shape (k,)."""
    parts: Vector
    """Parts of the force on each node by the same guess, shape (k,)."""

    @property
    def push(self) -> Vector:
        """Force of the sphere in Bullet, N, shape (3,)."""
        return self.probe.contacts[self.sphere]


class Contacts:
    """Finds the spheres touching organs, and sets their gains."""

    def __init__(self, tissues: Sequence[Tissue]) -> None:
        self._tissues = tissues

    def update(self, probes: Sequence[Probe]) -> None:
        """Find the faces near each probe, and correct every gain by the force on the tissue.

        The organs' nodes have just been read.
        """
        touches: list[list[_Touch]] = [[] for _ in self._tissues]
        for probe in probes:
            loose = np.flatnonzero(~probe.held)
            probe.near = [_near(tissue.organ, probe, loose) for tissue in self._tissues]
            found = [_touches_by_sphere(near, probe, loose) for near in probe.near]
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
                _correct_gains(tissue, here)
            tissue.advance()


def _near(organ: Organ, probe: Probe, loose: Indices) -> NearFaces:
    """Return the faces near the spheres `loose`: in contact, or within the probe's sight."""
    reach = np.maximum(probe.radii[loose] + BAND_M, probe.sight)
    return near_faces(probe.positions[loose], reach, organ.nodes, organ.touchable)


def _touches_by_sphere(near: NearFaces, probe: Probe, loose: Indices) -> dict[int, _Touch]:
    """Return the touches among the spheres `loose`, by number."""
    reach = probe.radii[loose] + BAND_M
    pairs, faces, weights, distances = near.within(reach)
    starts = np.searchsorted(pairs, np.arange(len(loose) + 1)).tolist()
    return {
        sphere: _touch_at(probe, sphere, reach[i], faces[start:end], weights[start:end], distances[start:end])
        for i, (sphere, start, end) in enumerate(zip(loose.tolist(), starts[:-1], starts[1:], strict=True))
        if start < end
    }


def _touch_at(
    probe: Probe, sphere: int, reach: float, faces: Indices, weights: Vector, distance: Vector
) -> _Touch:
    share, s = reach - distance, np.einsum("fi,fi->f", weights, weights)
    guess = float(share @ ((1.0 + s) ** 2 / (4.0 * s)) / share.sum())
    touched, place = np.unique(faces, return_inverse=True)
    parts = np.bincount(place.ravel(), (share[:, None] * weights).ravel()) / share.sum() + _LEAST_PART
    return _Touch(probe, sphere, float(distance.min()), guess, touched, parts)


def _correct_gains(tissue: Tissue, touches: Sequence[_Touch]) -> None:
    """Correct the guesses by the forces on the nodes.

    The force on a node shared by spheres is divided by the guesses.
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
