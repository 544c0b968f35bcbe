"""Collisions of instruments, with each other and with fixtures: boards, posts, walls, dishes."""

from __future__ import annotations

from collections.abc import Iterable

import mujoco
import numpy as np
from numpy.typing import NDArray

from schemas.vectors import Vector

__all__ = ["COLLISIONS", "Collisions"]

COLLISIONS = ("tools/impulse", "fixtures/impulse")
"""Names of the outputs: between instruments of different arms; between instruments and fixtures."""
_NEITHER = -1


class Collisions:
    """The impulses (N s) of all collisions since the start: sums of force times sub-step, shape (2,)."""

    def __init__(
        self, model: mujoco.MjModel, owners: NDArray[np.intp], fixtures: Iterable[str], step: float
    ) -> None:
        """Watch geoms of `model` by owner: the arms `owners` (-1: none) and `fixtures`, by name.

        `step` is the sub-step, s.
        """
        names = tuple(fixtures)
        bodies = [model.body(i).name.partition("/")[0] in names for i in range(model.nbody)]
        self._owners, self._fixed = owners, np.array(bodies)[model.geom_bodyid]
        self._step = step
        self._sums = np.zeros(len(COLLISIONS))
        self._shown = np.zeros(len(COLLISIONS))
        self.outputs = {name: self._shown[i : i + 1] for i, name in enumerate(COLLISIONS)}

    def kinds(self, geoms: NDArray[np.int32]) -> NDArray[np.intp]:
        """Return for pairs of geoms, shape (n, 2), the index of the sum for the contact, -1 for none."""
        is_tool, is_fixed = self._owners[geoms] >= 0, self._fixed[geoms]
        tools, fixed = is_tool.all(axis=1), is_tool.any(axis=1) & is_fixed.any(axis=1)
        return np.where(tools, 0, np.where(fixed, 1, _NEITHER))

    def add(self, kinds: NDArray[np.intp], forces: Vector) -> None:
        """Add the forces (N), shape (n, 3), of a sub-step in contacts of these kinds."""
        for kind, force in zip(kinds.tolist(), forces, strict=True):
            if kind != _NEITHER:
                self._sums[kind] += np.linalg.norm(force) * self._step

    def refresh(self) -> None:
        """Update the outputs."""
        self._shown[:] = self._sums

    @property
    def state(self) -> Vector:
        """The sums, shape (2,); the same array at every call."""
        return self._sums

    @state.setter
    def state(self, state: Vector) -> None:
        self._sums[:] = state
