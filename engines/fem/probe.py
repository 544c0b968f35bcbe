"""A probe: the spheres of an instrument in another engine, as they go through tissue."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from engines.tissue.probes.near_faces import NearFaces
from engines.tissue.probes.params import Coupling, ProbeParams
from engines.tissue.probes.sub_grid import SubGrid
from hub.participant import BondPlan, ForceSide, Inputs
from schemas.ports import BondSide
from schemas.vectors import Vector

__all__ = ["RIGID", "Probe"]

RIGID = Coupling(stiffness=np.inf, least_stiffness=np.inf, mass=0.0, damping=0.0, reset_time=None)
"""No virtual coupling: the spheres in the tissue go where the instrument goes."""

_FOLLOW_S = 6e-3
"""Time constant of the yield of springs in series: less than a hand feels, more than a node swings."""
_HELD_LOOP = 0.2
"""Share of the rate for held tissue: its mesh is up to five times as stiff as the patch."""


class Probe:
    """Spheres that move as the instrument does, less the yield of springs in series with a coarse mesh."""

    def __init__(
        self, params: ProbeParams, bond: BondSide, plan: BondPlan, first: int, sub_steps: int
    ) -> None:
        """`first`: the engine's number of the first sphere; `sub_steps`: their number in a step."""
        n = len(params.radii)
        self.name, self.radii = bond.name, params.radii
        self.bodies = list(range(first, first + n))
        self.targets: Vector = np.full((n, 3), 1e3)
        self.positions: Vector = self.targets
        self.held: NDArray[np.bool_] = np.zeros(n, dtype=np.bool_)
        self.touching: NDArray[np.bool_] = np.zeros(n, dtype=np.bool_)
        self.near: Sequence[NearFaces] = ()
        self.sub_grid: SubGrid | None = None
        self._side = ForceSide(bond, plan)
        self._size = bond.size
        self._shares: Vector = np.linspace(0.0, 1.0, sub_steps + 1)
        self._forces: Vector = np.zeros((n, 3))
        self._offsets: Vector = np.zeros((n, 3))
        """Yield of the springs in series, m, shape (n, 3)."""
        self._velocity: Vector = np.zeros((n, 3))
        self._compliance: Vector = np.zeros((3, 3))
        self._is_soft = False
        self._at_start = True

    @property
    def forces(self) -> Vector:
        """Mean force of the instrument on every sphere in the last step, N, shape (n, 3)."""
        return self._forces

    @property
    def sight(self) -> float:
        """Distance from a sphere's centre for the search of faces before contact, m."""
        return 0.0 if self.sub_grid is None else self.sub_grid.sight(self._velocity[0])

    def hold(self, spheres: NDArray[np.int64], *, held: bool) -> None:
        """Mark spheres as holding tissue or not; a spring in series goes with what is let go."""
        self.held[spheres] = held
        self._is_soft &= held

    def soften(self, spheres: NDArray[np.int64], compliance: Vector) -> None:  # noqa: ARG002
        """Put a spring of `compliance` (m/N, shape (3, 3)) in series with the pull of the held spheres."""
        values, axes = np.linalg.eigh(compliance)
        self._compliance = (axes * np.maximum(values, 0.0)) @ axes.T
        self._is_soft = True

    def begin(self, inputs: Inputs, seconds: float) -> Vector:
        """Return the ways of the spheres in a step of `seconds`, m, in `world`, shape (k + 1, n, 3)."""
        self._side.begin(inputs, seconds)
        n = len(self.radii)
        ends: list[float] = (seconds * self._shares).tolist()
        on_instrument = np.array([self._side.position(end) for end in ends])[:, : 3 * n].reshape(-1, n, 3)
        before = self._offsets
        self._offsets = self._yielded(seconds)
        if self._at_start:
            before, self._at_start = self._offsets, False
        path = on_instrument - (before + self._shares[:, None, None] * (self._offsets - before))
        self.targets, self.positions = on_instrument[-1], path[-1]
        self._velocity = (on_instrument[-1] - on_instrument[0]) / seconds
        return path

    def end(self, forces: Vector, seconds: float) -> dict[str, Vector]:
        """Return reaction and work of a step of `seconds`.

        forces: of the tissue on every sphere in every sub-step, N, shape (k, n, 3).
        """
        dt = seconds / len(forces)
        none = np.zeros(self._size)
        pushed = np.zeros(self._size)
        for i, force in enumerate(forces):
            pushed = np.zeros(self._size)
            pushed[: force.size] = -force.ravel()
            self._side.add(pushed, none, (i + 0.5) * dt, dt)
        self._forces = -forces.mean(axis=0)
        return self._side.result(pushed, none)

    @property
    def idle(self) -> dict[str, Vector]:
        """Force or wrench, and work, before anything has moved."""
        return {self._side.force_port: np.zeros(self._size), self._side.work_port: np.zeros(1)}

    @property
    def numbers(self) -> Vector:
        """Everything that the next step depends on, to be set again."""
        own = (
            self.targets.ravel(),
            self.positions.ravel(),
            self._forces.ravel(),
            self._offsets.ravel(),
            self._velocity.ravel(),
            self.held,
            self.touching,
            self._compliance.ravel(),
            np.array([self._is_soft, self._at_start]),
            self._side.state,
            np.zeros(0) if self.sub_grid is None else self.sub_grid.numbers,
        )
        return np.concatenate(own, dtype=np.float64)

    @numbers.setter
    def numbers(self, numbers: Vector) -> None:
        n, side = len(self.radii), len(self._side.state)
        at = np.cumsum([3 * n] * 5 + [n, n, 9, 2, side])
        parts = np.split(numbers.copy(), at)
        self.targets, self.positions, self._forces, self._offsets, self._velocity = (
            part.reshape(n, 3) for part in parts[:5]
        )
        self.held, self.touching = parts[5] > 0.0, parts[6] > 0.0
        self._compliance = parts[7].reshape(3, 3)
        self._is_soft, self._at_start = (parts[8] > 0.0).tolist()
        self._side.state = parts[9]
        if self.sub_grid is not None:
            self.sub_grid.numbers = parts[10]

    def _yielded(self, seconds: float) -> Vector:
        """Return how far the springs in series yield at the end of the next step, m, shape (n, 3)."""
        rate = min(1.0, seconds / _FOLLOW_S)
        if self.sub_grid is not None:
            self.sub_grid.follow(float(self._forces[0] @ self.sub_grid.inward), rate)
            return (self.sub_grid.yielded * self.sub_grid.inward)[None]
        if self._is_soft:
            wanted = self._compliance @ self._forces[self.held].sum(axis=0)
            offsets = self._offsets.copy()
            offsets[self.held] += rate * (wanted - offsets[self.held]) * _HELD_LOOP
            return offsets
        return self._offsets * (1.0 - rate)
