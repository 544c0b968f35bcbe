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
from engines.bullet.meshing.tet_mesh import Indices
from engines.bullet.organs.organ import Organ
from engines.bullet.probes.near_faces import NearFaces, near_faces
from engines.bullet.probes.probe import Probe
from schemas.vectors import Vector

__all__ = ["BAND_M", "CONTACT_PERIOD_NS", "Contacts", "Tissue"]

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
        """Note which faces each probe is near to, and correct every gain by what the tissue receives.

        The organs' nodes have just been read.
        """
        touches: list[list[_Touch]] = [[] for _ in self._tissues]
        for probe in probes:
            loose = np.flatnonzero(~probe.held)
            probe.near = [_near(tissue.organ, probe, loose) for tissue in self._tissues]
            found = [_touches(near, probe, loose) for near in probe.near]
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


def _near(organ: Organ, probe: Probe, loose: Indices) -> NearFaces:
    """Return the faces that the spheres `loose` are near to: as far as they touch, or the probe looks."""
    reach = np.maximum(probe.radii[loose] + BAND_M, probe.sight)
    return near_faces(probe.positions[loose], reach, organ.nodes, organ.touchable)


def _touches(near: NearFaces, probe: Probe, loose: Indices) -> dict[int, _Touch]:
    """Return by number, of the spheres `loose`, those that touch."""
    reach = probe.radii[loose] + BAND_M
    pairs, faces, weights, distances = near.within(reach)
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
