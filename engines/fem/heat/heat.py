"""Heat of a body of linear tetrahedra: temperature, boiling, char, and damage; `_heat.c` steps it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import ceil

import numpy as np
from numpy.typing import NDArray

from engines.fem.heat.tissue import BODY, HeatTissue
from engines.tissue.meshing.tet_mesh import Indices
from schemas.soft_surface import FaceKind
from schemas.vectors import Vector

__all__ = ["HEAT_PERIOD_NS", "Heat"]

HEAT_PERIOD_NS = 10_000_000
"""Period of the steps of heat."""
_VAPORISED = 2
"""Stage of an element in `_heat.c`."""
_FASTEST = 1e3
"""A sliver evens out no faster, 1/s: the step of heat has at most ten sub-steps."""
_COLD = 1e-2
"""Largest rise of a body that counts as cold, K."""
_GIVEN, _PERFUSED, _BOILED, _VAPORISED_M3, _HOTTEST, _ASH, _EJECTED = range(7)
"""Places in the book."""


class Heat:
    """Arrays of a body.

    Elements keep their numbers; a cut adds nodes, and an element that goes has no volume: `rebind`.
    """

    def __init__(
        self,
        tissues: Sequence[HeatTissue],
        corners: Indices,
        gradients: Vector,
        volumes: Vector,
        nodes: int,
        kinds: NDArray[np.uint8] | None = None,
    ) -> None:
        """Bind a cold body; for the arrays see `rebind`.

        kinds: number among `tissues` of every element, shape (m,); default: the first.
        """
        from engines.fem import _heat  # built together with `_solid`, which says so where it is missing

        self._compiled = _heat
        self._constants = np.concatenate([tissue.constants for tissue in tissues])
        self._steam_per_joule = tissues[0].steam_per_joule
        m = len(corners)
        self._tissue = np.zeros(m, np.uint8) if kinds is None else np.ascontiguousarray(kinds, np.uint8)
        self._wet_capacity = np.array([tissue.capacity for tissue in tissues])[self._tissue]
        self._dry_capacity = np.array([tissue.dry_capacity for tissue in tissues])[self._tissue]
        self._corners = np.ascontiguousarray(corners, np.int32)
        self._volume = np.zeros(m, np.float32)
        self.rise = np.zeros(nodes)
        """Rise of every node above the temperature of the body, K, shape (n,)."""
        self.water = np.ones(m, np.float32)
        """Share of the water left in every element, shape (m,)."""
        self.excess = np.zeros(m, np.float32)
        """Excess of a dry element over the mean of its corners, K, shape (m,)."""
        self.damage = np.zeros((2, m), np.float32)
        """Damage integrals of colour and of cells, shape (2, m)."""
        self.stage = np.zeros(m, np.uint8)
        """0 tissue, 1 charred, 2 vaporised, shape (m,)."""
        self.book = np.zeros(7)
        """Heat given, perfused and boiled (J), volume vaporised (m^3), hottest rise (K), dry mass
        vaporised (kg), heat gone (J).
        """
        self.rebind(corners, gradients, volumes)

    def rebind(self, corners: Indices, gradients: Vector, volumes: Vector) -> None:
        """Take over a changed mesh.

        A new node is as warm as the node in whose place it stands; heat of elements that have gone is gone.

        Args:
            corners: nodes of every element, shape (m, 4).
            gradients: gradients of the shape functions of corners 1 to 3 at rest, 1/m, shape (m, 9).
            volumes: volumes at rest, m^3, 0 of an element that has gone, shape (m,).
        """
        gone = (self._volume > 0.0) & (volumes == 0.0)
        if gone.any():
            kept_heat = self._wet_capacity[gone] * self.rise[self._corners[gone]].mean(axis=1)
            dry_heat = self._dry_capacity[gone] * self.excess[gone]
            self.book[_EJECTED] += float(((kept_heat + dry_heat) * self._volume[gone]).sum())
        self._copy_nodes(corners)
        self._corners = np.ascontiguousarray(corners, np.int32)
        self._volume = np.ascontiguousarray(volumes, np.float32)
        self._conductance = np.zeros((len(corners), 6), np.float32)
        self._capacity = np.zeros(len(self.rise), np.float32)
        self._scratch = np.zeros((2, len(self.rise)), np.float32)
        shape = np.ascontiguousarray(gradients, np.float32), self._volume
        self._rate = self._compiled.bind(
            (self._corners, self._tissue, *shape, self._conductance, self._capacity),
            self._constants,
            _FASTEST,
        )
        self.rise[self._capacity == 0.0] = 0.0  # their elements have gone
        self.excess[self._volume == 0.0] = 0.0
        self._no_power = np.zeros(len(corners), np.float32)
        self._no_bursts = np.zeros(len(corners), np.uint8)

    def _copy_nodes(self, corners: Indices) -> None:
        """Append the nodes with numbers beyond the present ones."""
        known = len(self.rise)
        new = corners >= known
        if new.any():
            parents = np.zeros(int(corners.max()) + 1 - known, np.int64)
            parents[corners[new] - known] = self._corners[new]
            self.rise = np.concatenate([self.rise, self.rise[parents]])

    def restore(self, parts: Iterator[bytes], elements: tuple[Indices, Vector, Vector]) -> None:
        """Go back to a saved `state`, in a mesh with these `elements`, the arguments of `rebind`."""
        self.rise = np.frombuffer(next(parts)).copy()
        for array in self.state[1:]:
            array[...] = np.frombuffer(next(parts), array.dtype).reshape(array.shape)
        self._volume = np.ascontiguousarray(elements[2], np.float32)
        self.rebind(*elements)

    @property
    def is_cold(self) -> bool:
        """Whether the whole body is at its own temperature, so that no step is needed."""
        return self.book[_HOTTEST] == 0.0

    def advance(
        self,
        seconds: float,
        power: NDArray[np.float32] | None = None,
        bursts: NDArray[np.bool_] | None = None,
    ) -> float:
        """Advance by `seconds` with a power (W) in every element, shape (m,); return the smoke, kg.

        `bursts`: elements that steam takes away once the power has dried them, shape (m,); default: none.
        Smoke is steam, and the dry rest of vaporised elements.
        """
        if power is None and self.is_cold:
            return 0.0
        boiled, ash = self.book[[_BOILED, _ASH]].tolist()
        sub_steps = max(1, ceil(seconds * self._rate))
        arrays = (
            self._corners,
            self._tissue,
            self._conductance,
            self._volume,
            self._capacity,
            self._no_power if power is None else power,
            self._no_bursts if bursts is None else bursts.view(np.uint8),
            self.rise,
            self.water,
            self.excess,
            self.damage,
            self.stage,
            self._scratch,
        )
        self._compiled.advance(arrays, self._constants, self.book[:_EJECTED], seconds / sub_steps, sub_steps)
        if power is None and self.book[_HOTTEST] < _COLD:
            self._cool_down()
        return float(self._steam_per_joule * (self.book[_BOILED] - boiled) + self.book[_ASH] - ash)

    @property
    def capacity(self) -> Vector:
        """Heat capacity of every node, J/K, 0 of a node without an element, shape (n,)."""
        return self._capacity.astype(np.float64)

    def warm(self, nodes: NDArray[np.integer], heat: Vector) -> None:
        """Give heat (J, shape (k,)) to nodes; negative heat is taken."""
        capacity = self.capacity[nodes]
        kept = np.where(capacity > 0.0, heat, 0.0)
        np.add.at(self.rise, nodes, kept / np.maximum(capacity, 1e-30))
        self.book[_GIVEN] += kept.sum()
        self.book[_HOTTEST] = max(float(self.book[_HOTTEST]), float(self.rise.max(initial=0.0)))

    def spread(self, nodes: Vector, poles: Vector, reach: float) -> tuple[NDArray[np.float32], float]:
        """Return the share of a current's heat in every element, shape (m,), and the sum of the shares.

        A share is volume times square of the current density, as in a homogeneous body of infinite extent.

        Args:
            nodes: present nodes, m, shape (n, 3).
            poles: centre (m), radius (m) and signed current of every pole, shape (p, 5).
            reach: distance from the poles beyond which nothing is heated, m.
        """
        shares = np.zeros(len(self._corners), np.float32)
        arrays = self._corners, self._volume, np.ascontiguousarray(nodes), np.ascontiguousarray(poles), shares
        return shares, self._compiled.spread(arrays, reach)

    @property
    def temperature(self) -> Vector:
        """Temperature of every node, degrees C, shape (n,)."""
        return BODY + self.rise

    @property
    def hottest(self) -> float:
        """Highest temperature of nodes and dry elements, degrees C."""
        return BODY + float(self.book[_HOTTEST])

    @property
    def kinds(self) -> NDArray[np.uint8]:
        """`FaceKind` of every element: outside, coagulated or charred, shape (m,)."""
        found = np.where(self.damage[0] >= 1.0, FaceKind.COAGULATED, FaceKind.OUTSIDE).astype(np.uint8)
        found[self.stage > 0] = FaceKind.CHARRED
        return found

    @property
    def dead(self) -> NDArray[np.bool_]:
        """Elements whose cells are dead, shape (m,)."""
        return self.damage[1] >= 1.0

    def vaporised(self) -> Indices:
        """Return the numbers of elements to be removed."""
        return np.flatnonzero((self.stage == _VAPORISED) & (self._volume > 0.0))

    @property
    def stored(self) -> float:
        """Heat above the temperature of the body, without the heat of steam, J."""
        wet = self._capacity.astype(np.float64) @ self.rise
        return float(wet + (self._dry_capacity * self._volume) @ self.excess)

    @property
    def imbalance(self) -> float:
        """Heat given, less the heat stored and lost, J: an error of the method."""
        lost = self.book[_PERFUSED] + self.book[_BOILED] + self.book[_EJECTED]
        return float(self.book[_GIVEN] - lost - self.stored)

    @property
    def state(self) -> tuple[NDArray[np.float32] | NDArray[np.uint8] | Vector, ...]:
        """Arrays that the next step depends on, to be written."""
        return self.rise, self.water, self.excess, self.damage, self.stage, self.book

    def _cool_down(self) -> None:
        self.book[_EJECTED] += self.stored
        self.rise[:] = 0.0
        self.excess[:] = 0.0
        self.book[_HOTTEST] = 0.0
