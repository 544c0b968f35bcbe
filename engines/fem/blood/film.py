"""A film of liquid on the surface of a body; `_film.c` moves it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schemas.vectors import Vector

__all__ = ["BILE", "BLOOD", "QUANTUM", "SALINE", "Film", "Liquid"]

QUANTUM = 1e-18
"""Volume of a whole part of liquid, m^3, as in `_film.c`."""
_HANGING_M = 0.5e-3
"""Thickest film on a surface that looks down: more drips off. Chosen: a quarter of the capillary length of
blood, 2.2 mm.
"""
_DOWN = -0.1
"""Upward part of the normal of a surface below which the surface looks down."""
_SUB_STEP_S = 2e-3
"""Longest step: up to 0.3 mm thick, a film on a wall runs by less than a node."""


@dataclass(frozen=True)
class Liquid:
    """A Newtonian liquid."""

    name: str
    density: float
    """kg/m^3."""
    viscosity: float
    """Pa s."""


BLOOD = Liquid("blood", 1064.0, 3.35e-3)
"""Mean of 30 healthy people at 37 degrees C (Wesolowski, Mlynarczak, Preprints 2019, 201907.0090)."""
BILE = Liquid("bile", 1010.0, 1.5e-3)
"""Assumed, between water and the bile of a gallbladder."""


SALINE = Liquid("saline", 1005.0, 0.7e-3)
"""Isotonic saline at 37 degrees C, as water but for 0.9 % of salt."""


class Film:
    """Liquid at the nodes of a surface, in whole parts: what is there is only ever moved."""

    def __init__(self, liquid: Liquid, nodes: int, gravity: float) -> None:
        """Begin dry. `gravity`: m/s^2, along -z."""
        from engines.fem import _film  # built together with `_solid`, which says so where it is missing

        self._compiled = _film
        self.liquid = liquid
        self.amounts: NDArray[np.int64] = np.zeros(nodes, np.int64)
        """Liquid at each node, in parts of `QUANTUM`, shape (n,)."""
        self.saline: NDArray[np.int64] | None = None
        """Saline in `amounts` at each node, well mixed with the rest, shape (n,); None: there is none."""
        self._mobility = liquid.density * gravity / (3.0 * liquid.viscosity)
        self._thinner = SALINE.density * liquid.viscosity / (SALINE.viscosity * liquid.density)
        self._scratch: tuple[NDArray[np.generic], ...] = ()

    def append(self, nodes: int) -> None:
        """Let the surface have `nodes` nodes: new ones are dry."""
        added = nodes - len(self.amounts)
        self.amounts = np.concatenate([self.amounts, np.zeros(added, np.int64)])
        if self.saline is not None:
            self.saline = np.concatenate([self.saline, np.zeros(added, np.int64)])

    def may_be_irrigated(self) -> None:
        """Count saline apart from now on."""
        self.saline = np.zeros(len(self.amounts), np.int64)

    def irrigate(self, nodes: NDArray[np.int64], amount: int) -> None:
        """Put saline onto nodes, to each as much as to the others, the first one takes the rest."""
        if self.saline is None or not len(nodes):
            return
        each, rest = divmod(amount, len(nodes))
        for amounts in (self.amounts, self.saline):
            amounts[nodes] += each
            amounts[nodes[0]] += rest

    def emit(
        self, faces: NDArray[np.int32], places: Vector, velocity: Vector, seconds: float
    ) -> tuple[Vector, int]:
        """Add what comes out of faces in `seconds`.

        Return the flow out of each (m^3/s, shape (f,)), and how much has come.

        Args:
            faces: nodes of the faces, -1: no face, shape (f, 3).
            places: places of the nodes, m, shape (n, 3).
            velocity: flow per area, m/s, shape (f,).
            seconds: length of the step.
        """
        rates: Vector = np.zeros(len(faces))
        emitted = self._compiled.emit((faces, places, velocity, rates, self.amounts), seconds)
        return rates, emitted

    def run(self, faces: NDArray[np.int32], places: Vector, seconds: float) -> int:
        """Let the liquid run for `seconds`; return how much of it drips off, saline included."""
        sub_steps = max(1, round(seconds / _SUB_STEP_S))
        saline = () if self.saline is None else (self.saline,)
        return self._compiled.run(
            (*self._arrays(faces, places, self.amounts), *saline),
            self._mobility,
            _HANGING_M,
            _DOWN,
            self._thinner,
            seconds / sub_steps,
            sub_steps,
        )

    def take(self, nodes: NDArray[np.int64], most: int) -> int:
        """Take away up to `most` from these nodes, in proportion; return how much, saline included."""
        there = self.amounts[nodes]
        total = int(there.sum())
        taken = there if total <= most else (there * (most / total)).astype(np.int64)
        if self.saline is not None:
            saline = self.saline[nodes]
            part = (taken * (saline / np.maximum(there, 1))).astype(np.int64)
            self.saline[nodes] -= np.clip(
                part, np.maximum(taken - (there - saline), 0), np.minimum(saline, taken)
            )
        self.amounts[nodes] -= taken
        return int(taken.sum())

    def thickness(self, faces: NDArray[np.int32], places: Vector, step: float) -> NDArray[np.uint8]:
        """Return the thickness at each node in steps of `step` (m), at most 255, shape (n,).

        Saline is clear: diluted liquid is as thick as the liquid in it.
        """
        found = np.zeros(len(self.amounts), np.uint8)
        coloured = self.amounts if self.saline is None else self.amounts - self.saline
        self._compiled.measure((*self._arrays(faces, places, coloured), found), step)
        return found

    def _arrays(
        self, faces: NDArray[np.int32], places: Vector, amounts: NDArray[np.int64]
    ) -> tuple[NDArray[np.generic], ...]:
        n, f = len(self.amounts), len(faces)
        if not self._scratch or len(self._scratch[0]) != n or len(self._scratch[-1]) != f:
            self._scratch = (*(np.zeros(n) for _ in range(5)), np.zeros((f, 3)), np.zeros(f, np.int32))
        return faces, places, amounts, *self._scratch
