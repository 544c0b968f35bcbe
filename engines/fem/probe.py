"""A probe: the spheres of an instrument in another engine, as they go through tissue."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray
from xxhash import xxh3_128_digest

from engines.fem.place import find_place
from engines.fem.solid import Branch
from engines.fem.spheres import Spheres
from engines.tissue.probes.held_patch import PatchCompliance
from engines.tissue.probes.near_faces import NearFaces
from engines.tissue.probes.params import Coupling, ProbeParams
from engines.tissue.probes.place import Surface
from engines.tissue.probes.sub_grid import LAW_POINTS, SubGrid
from hub.participant import BondPlan, Inputs
from schemas.ports import BondSide, bond_ports
from schemas.vectors import Vector

__all__ = ["RIGID", "Probe"]

RIGID = Coupling(stiffness=np.inf, least_stiffness=np.inf, mass=0.0, damping=0.0, reset_time=None)
"""No virtual coupling: the spheres in the tissue go where the instrument goes."""

_PREDICTIONS = ("hold", "velocity", "slope")
"""Predicted motions by their numbers in `_probe.c`."""
_LEAP_M = 1.0
"""Way in a step that no arm moves an instrument: an exchange of instruments does."""
_FAR_M = 1e3
"""Place of spheres before the first step."""


class Probe:
    """Spheres that move as the instrument does, less the yield of springs in series with a coarse mesh.

    `_probe.c` has the arithmetic of a step, over the arrays here.
    """

    def __init__(
        self,
        params: ProbeParams,
        bond: BondSide,
        plan: BondPlan,
        spheres: Spheres,
        first: int,
        surfaces: Sequence[Surface] | None = None,
        series: Sequence[Sequence[Branch]] = (),
    ) -> None:
        """`first`: number of the first sphere among all; `surfaces`: stated for a spring in series.

        series: relaxation of each surface.
        """
        from engines.fem._probe import Probe as Compiled

        n, size = len(params.radii), bond.size
        self.name, self.radii = bond.name, params.radii
        self.bodies = list(range(first, first + n))
        self.sub_grid = (
            None if surfaces is None else SubGrid(float(self.radii[0]), RIGID, surfaces, find_place)
        )
        points = 0 if surfaces is None else LAW_POINTS
        self._terms: list[Vector] = [
            np.array([[one.share, one.seconds] for one in branches]).reshape(-1, 2) for branches in series
        ]
        most = max((len(terms) for terms in self._terms), default=0)
        sizes = (6 * n + 2 * size, 3, 3 * n, 3 * n, 3 * n, 3 * n, 4, 3 * points, 18, 2 * most, most + 1)
        self._state: Vector = np.zeros(sum(sizes))
        ends = list(accumulate(sizes))
        motion, clock, offsets, forces, targets, positions, spring, law, compliance, terms, relaxing = (
            self._state[end - count : end] for end, count in zip(ends, sizes, strict=True)
        )
        self.targets, self.positions, self.forces = (
            part.reshape(n, 3) for part in (targets, positions, forces)
        )
        self.targets[:] = self.positions[:] = _FAR_M
        self._spring, self._law = spring, law.reshape(3, points)
        self._compliance = compliance.reshape(2, 3, 3)
        """Compliance of the spring in series with held spheres, m/N, and share of the mesh in all yield."""
        self._series, self._elastic_force = terms.reshape(most, 2), relaxing[most:]
        self._velocity = motion[3 * n : 3 * n + 3]
        self.held: NDArray[np.bool_] = np.zeros(n, dtype=np.bool_)
        self.touching: NDArray[np.bool_] = np.zeros(n, dtype=np.bool_)
        self._position_port, self._velocity_port, force_port = (port.name for port in bond_ports(bond))
        reaction: Vector = np.zeros(size)
        self.outputs: dict[str, Vector] = {force_port: reaction, f"{bond.name}/work": clock[2:]}
        """Force or wrench, and work, at the end of the last step."""
        self._compiled = Compiled(
            (
                motion,
                clock,
                reaction,
                offsets,
                forces,
                targets,
                positions,
                spring,
                self._law,
                compliance,
                self.held,
                terms,
                relaxing,
                spheres.path,
                spheres.forces,
            ),
            first,
            _PREDICTIONS.index(plan.prediction),
            plan.mean,
        )

    @property
    def sight(self) -> float:
        """Distance from a sphere's centre for the search of faces before contact, m."""
        return 0.0 if self.sub_grid is None else self.sub_grid.sight(self._velocity)

    def hold(self, spheres: NDArray[np.int64], *, held: bool) -> None:
        """Mark spheres as holding tissue or not; a spring in series goes with what is let go."""
        self.held[spheres] = held
        if not held:
            self._compliance[:] = 0.0

    def soften(self, spheres: NDArray[np.int64], patch: PatchCompliance) -> None:  # noqa: ARG002
        """Put a spring of the compliance that is missing in series with the pull of the held spheres.

        Rigid in directions of negative compliance, as no spring in series stiffens.
        """
        values, axes = np.linalg.eigh(patch.missing)
        missing = (axes * np.maximum(values, 0.0)) @ axes.T
        self._compliance[:] = missing, patch.mesh @ np.linalg.inv(patch.mesh + missing)

    def leaves(self, inputs: Inputs) -> bool:
        """Return whether the instrument is taken out of the arm, away from the tissue that it holds."""
        if not self.held.any():
            return False
        way = inputs[self._position_port][:3] - self.targets[0]
        return float(way @ way) > _LEAP_M**2

    def begin(self, inputs: Inputs, seconds: float) -> None:
        """Write the ways of the spheres in a step of `seconds` to `Spheres.path`."""
        self._compiled.begin(inputs[self._position_port], inputs[self._velocity_port], seconds)

    def end(self) -> bool:
        """Set reaction and work of the step by `Spheres.forces`; return whether they are finite."""
        return self._compiled.end()

    def follow(self, near: Sequence[NearFaces]) -> None:
        """Set the law of the spring in series at the place of the sphere, with these faces in its sight."""
        if self.sub_grid is not None:
            self._relax(near)
            force = self._elastic_force * self.sub_grid.inward if len(self._series) else self.forces[0]
            self.sub_grid.update(self.positions[0], force, near)
            self._law[:] = self.sub_grid.law
            self._spring[:3] = self.sub_grid.inward
            if not self.sub_grid.inward.any():
                self._spring[3] = 0.0

    def _relax(self, near: Sequence[NearFaces]) -> None:
        """Take the relaxation of the nearest organ, where one relaxes."""
        if not len(self._series):
            return
        distances = [faces.distances.min(initial=np.inf) for faces in near]
        nearest = int(np.argmin(distances))
        if np.isfinite(distances[nearest]):
            terms = self._terms[nearest]
            self._series[:] = 0.0
            self._series[: len(terms)] = terms

    @property
    def digest(self) -> bytes:
        """16 bytes by the state of spheres, bond and spring."""
        return xxh3_128_digest(
            b"".join((self._state.tobytes(), self.held.tobytes(), self.touching.tobytes()))
        )

    @property
    def numbers(self) -> Vector:
        """Everything that the next step depends on, to be set again."""
        spring = np.zeros(0) if self.sub_grid is None else self.sub_grid.numbers
        return np.concatenate([self._state, self.held, self.touching, spring], dtype=np.float64)

    @numbers.setter
    def numbers(self, numbers: Vector) -> None:
        n = len(self.radii)
        state, held, touching, spring = np.split(numbers, np.cumsum([len(self._state), n, n]))
        self._state[:] = state
        self.held[:], self.touching[:] = held > 0.0, touching > 0.0
        if self.sub_grid is not None:
            self.sub_grid.numbers = spring
