"""A spring in series with the virtual coupling: the missing compliance of a coarse mesh under a small sphere.

Under a sphere as small as the edges of the mesh, the mesh cannot form the dent, and the force is a multiple
of the tissue's. The missing yield is known: the tissue's yield at a force is the half-space's
(`elasticity/half_space.py`) with the effect of the other boundaries of the body (`elasticity/compliance.py`);
the mesh's own yield is the linear compliance at the place, times a ratio measured during the press. The
difference is a nonlinear spring along the normal of the surface, in series with spring and damper of the
coupling. See docs/decisions/0086-force-of-tissue.md.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from engines.tissue.elasticity.half_space import DEEPEST, sphere_force
from engines.tissue.elasticity.rims import RimWatch, rim_share
from engines.tissue.probes.near_faces import BAND_M, CONTACT_PERIOD_NS, NearFaces
from engines.tissue.probes.params import Coupling
from engines.tissue.probes.place import Place, Surface, find_place
from engines.tissue.warn_once import warn_once
from schemas.vectors import Vector

__all__ = ["LAW_POINTS", "SubGrid", "warn_beyond"]

LAW_POINTS = 160
"""Number of points of the spring's law, dense at small forces with a steep law."""

_GRID_DEPTH = 4.0
"""Largest depth of the law, in radii; beyond the table with the last share of Hertz's force."""

_NEAR_M = 1e-3
"""How far before the surface the spring is ready, beside the way of two readings."""

_FILTER = 0.2
"""Share of the way to a measured value gone at each reading: a time constant of 36 ms."""

_LEAST_FORCE_N = 5e-3
"""Least force for a measured ratio: below, the inertia of the touched nodes matters."""

_SPREAD_POWER, _MOST_SPREAD = 2.0 / 3.0, 2.0
"""Spreading of the force from the first touched face to its neighbours: power of the force (growth of a
Hertzian contact), and limit as a multiple of the force with known parts.
"""

_RIM_BEGINS, _RIM_ENDS = 1.0, 1.6
"""Distances from a rim, in radii: up to the first the law is a quarter-space's, from the second on a
half-space's, with an error of 5 % there (docs/decisions/0095-converged-truth.md).
"""

_SWAYING, _LEAST_LOCAL = 0.5, 0.02
"""Share of the yield of the mesh that is a motion of the whole body, from which on the spring follows by the
rest alone; and the least such rest. A loose lobe sways in seconds, the spring follows in milliseconds.
"""
_RATIOS = (0.2, 2.0)
"""Limits of the ratio."""


class SubGrid:
    """The spring of a sphere: present yield, and law at the sphere's place."""

    def __init__(
        self,
        radius: float,
        coupling: Coupling,
        surfaces: Sequence[Surface],
        find: Callable[[Surface, NearFaces, float], Place] = find_place,
    ) -> None:
        """`find`: `find_place`, or the same in C."""
        self._radius, self._coupling, self._surfaces, self._find = radius, coupling, surfaces, find
        self._rims = {
            id(one): RimWatch(one.compliance.rims, one.settled, _RIM_ENDS * radius) for one in surfaces
        }
        self._depths: Vector = np.linspace(0.0, 1.0, LAW_POINTS) ** 2 * _GRID_DEPTH * radius
        self._half_spaces = [sphere_force(self._depths, radius, one.material) for one in surfaces]
        self.yielded = 0.0
        """How far the spring is compressed, m."""
        self.inward = np.zeros(3)
        """Direction of the spring in `world`, shape (3,); zeros: rigid, away from tissue."""
        self.ratio = 1.0
        """Yield of the mesh over linear compliance times force."""
        self.is_beyond = False
        """Whether the sphere has been deeper than `DEEPEST` radii: there the law is extrapolated."""
        self._speed: float = 0.0  # of the yield, m/s
        self._is_new = False  # the law
        self._forces = self._yields = self._mesh_yields = np.zeros(1)
        self._rim: float = 0.0  # how far the law is that of a rim, 0 to 1

    @property
    def state(self) -> Vector:
        """Yield, speed of the yield, direction, ratio, and the last point of the law, shape (8,)."""
        last = self._forces[-1], self._yields[-1]
        return np.array([self.yielded, self._speed, *self.inward, self.ratio, *last])

    @property
    def law(self) -> Vector:
        """Forces (N), yields of the spring and yields of the mesh (m), shape (3, `LAW_POINTS`).

        Zeros away from tissue.
        """
        law = np.zeros((3, LAW_POINTS))
        law[:, : len(self._forces)] = self._forces, self._yields, self._mesh_yields
        return law

    @property
    def numbers(self) -> Vector:
        """Everything that the next step depends on, to be set again, shape (10 + 3 `LAW_POINTS`,)."""
        flags = float(self._is_new), float(self.is_beyond), float(len(self._forces) == LAW_POINTS)
        return np.array(
            [self.yielded, self._speed, *self.inward, self.ratio, self._rim, *flags, *self.law.ravel()]
        )

    @numbers.setter
    def numbers(self, numbers: Vector) -> None:
        self.yielded, self._speed, self.ratio, self._rim = numbers[[0, 1, 5, 6]].tolist()
        self.inward = numbers[2:5].copy()
        self._is_new, self.is_beyond, has_law = (bool(flag) for flag in numbers[7:10].tolist())
        law = numbers[10:].reshape(3, LAW_POINTS)[:, : LAW_POINTS if has_law else 1].copy()
        self._forces, self._yields, self._mesh_yields = law

    def give_way(self, spring: Vector, damper: Vector, since: float, *, keep: bool) -> None:
        """Reduce the forces (N, shape (3,)) of a rigid coupling by the yield of the spring in series.

        since: time since the yield was last kept, s. The yield s follows from S(s) = k (e - s) + b (e' - s'),
        with the law S, the stretch e along the normal, and s' = (s - s_before) / since. A new law keeps s':
        keeping s would make the force leap.
        """
        coupling, inward = self._coupling, self.inward
        rate = 0.0 if self._is_new else coupling.damping / since
        known = -coupling.damping * self._speed if self._is_new else rate * self.yielded
        pressed = float(inward @ spring + inward @ damper) + known
        stiff = coupling.stiffness + rate
        yielded = float(np.interp(pressed, stiff * self._yields + self._forces, self._yields))
        speed = self._speed if self._is_new else (yielded - self.yielded) / since
        spring -= coupling.stiffness * yielded * inward
        damper -= coupling.damping * speed * inward
        if keep:
            self.yielded, self._speed, self._is_new = yielded, speed, False

    def sight(self, velocity: Vector) -> float:
        """Return how far (m) from the centre of a sphere with this velocity (m/s) a face may soon be touched.

        velocity: shape (3,).
        """
        return self._radius + _NEAR_M + 2e-9 * CONTACT_PERIOD_NS * float(np.sqrt(velocity @ velocity))

    def update(self, centre: Vector, force: Vector, near: Sequence[NearFaces]) -> None:
        """Set the law of the sphere's place; the organs' nodes have just been read.

        Args:
            centre: centre of the sphere, m, in `world`, shape (3,).
            force: force of the coupling on the sphere, N, shape (3,).
            near: faces in the sphere's `sight`, of each surface.
        """
        places = [
            (self._find(surface, faces, self._radius), forces)
            for surface, forces, faces in zip(self._surfaces, self._half_spaces, near, strict=True)
            if len(faces.spheres)
        ]
        if not places:
            self.yielded, self._speed, self.inward, self.ratio = 0.0, 0.0, np.zeros(3), 1.0
            self._forces = self._yields = self._mesh_yields = np.zeros(1)
            return
        place, self._forces = min(places, key=lambda one: one[0].distance)
        place = self._at_rim(place, centre)
        between = self._measure(place, centre, force)
        self._yields = self._missing(place, between, max(float(force @ self.inward), _LEAST_FORCE_N))
        self._is_new = True

    def _at_rim(self, place: Place, centre: Vector) -> Place:
        """Set the forces of a quarter-space near a rim, with a transition to a half-space.

        Return the place with the sphere's direction of pressing on a rim.
        """
        surface, radius = place.surface, self._radius
        self._rim = 0.0
        if not len(surface.compliance.rims.ends):
            return place
        moved = place.parts @ (surface.organ.nodes[place.nodes] - surface.settled[place.nodes])
        inward = self.inward if self.inward.any() else place.inward
        found = self._rims[id(surface)].near(centre - moved, inward)
        if found is None:
            return place
        away, inward = found
        self._rim = min((_RIM_ENDS * radius - away) / (_RIM_ENDS * radius - _RIM_BEGINS * radius), 1.0)
        share = rim_share(away / radius, self._depths / radius)
        self._forces = self._forces * (1.0 + self._rim * (share - 1.0))
        mixed = place.inward + self._rim * (inward - place.inward)
        return replace(place, inward=mixed / np.sqrt(mixed @ mixed))

    def _measure(self, place: Place, centre: Vector, force: Vector) -> Vector:
        """Set direction and ratio, and return the compliance between the nodes (m/N), shape (k, k)."""
        touches = place.distance < self._radius + BAND_M
        if touches and self.inward.any():
            mixed = self.inward + _FILTER * (place.inward - self.inward)
            self.inward = mixed / np.sqrt(mixed @ mixed)
        else:
            self.inward, self.ratio = place.inward, 1.0
        between = place.surface.compliance.of_mesh(place.nodes, self.inward)
        pressed = float(force @ self.inward)
        if touches and pressed > _LEAST_FORCE_N:
            depth = self._radius + float((centre - place.point) @ self.inward)
            measured = depth / (float(place.parts @ between @ place.parts) * pressed)
            self.ratio += _FILTER * (min(max(measured, _RATIOS[0]), _RATIOS[1]) - self.ratio)
            self.is_beyond |= bool(np.interp(pressed, self._forces, self._depths) > DEEPEST * self._radius)
        return between

    def _missing(self, place: Place, between: Vector, pressed: float) -> Vector:
        """Return the body's depth less the yield of mesh and coupling, m, by force, shape (`LAW_POINTS`,).

        `pressed`: force of the present parts, N.
        """
        forces, first, more = self._forces, place.first_parts, place.parts - place.first_parts
        spread = np.minimum(forces / pressed, _MOST_SPREAD) ** _SPREAD_POWER
        mesh = first @ between @ first + spread * (
            2.0 * float(first @ between @ more) + spread * float(more @ between @ more)
        )
        compliance = place.surface.compliance
        body = compliance.of_body(place.nodes, place.parts)
        if self._rim:
            at_rim = compliance.of_body_at_rim(place.nodes, place.parts, -place.inward)
            body += self._rim * (at_rim - body)
        self._mesh_yields = self.ratio * mesh * forces
        swaying = body / max(float(first @ between @ first), 1e-30)
        if swaying > _SWAYING:
            rest = self._mesh_yields - self.ratio * body * forces
            self._mesh_yields = np.maximum(rest, _LEAST_LOCAL * self._mesh_yields)
        missing = self._depths + (body - self.ratio * mesh - 1.0 / self._coupling.stiffness) * forces
        return np.maximum.accumulate(np.maximum(missing, 0.0))


def warn_beyond(participant: str, probe: str, radius: float) -> None:
    """Warn once that a probe's sphere of `radius` (m) went deeper than the law is known."""
    warn_once(
        f"participant '{participant}', probe '{probe}': it pressed deeper than {DEEPEST:g} radii,"
        f" {DEEPEST * radius * 1e3:.3g} mm, up to which the force of tissue is known;"
        " beyond, it is extrapolated. Press less deep, or with a larger sphere"
    )
