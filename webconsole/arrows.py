"""Force arrows: where the bonds of a session act, and how strongly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from schemas.scenario import Scenario
from schemas.vectors import Vector, VectorCodec

__all__ = ["BondArrows", "bond_arrows"]


class BondArrows(NamedTuple):
    """The outlets of a bond: the points of action, and the force on the motion side."""

    place: str
    """A pose, or the positions of points, in the world."""
    force: str
    """A wrench, or the forces at the points."""

    @property
    def name(self) -> str:
        """Name of the bond: the motion side."""
        return self.place.rpartition("/")[0]

    @property
    def at_one_point(self) -> bool:
        """Whether there is a single point and a single force."""
        return self.place.endswith("/pose")

    def rows(self, place: Vector, force: Vector) -> NDArray[np.float32]:
        """Return point (m) and force (N) of each arrow, shape (points, 6), frame `world`."""
        points = place[:3].reshape(1, 3) if self.at_one_point else place.reshape(-1, 3)
        forces = force[:3].reshape(1, 3) if self.force.endswith("/wrench") else force.reshape(-1, 3)
        return np.hstack([points, forces]).astype(np.float32)


def bond_arrows(scenario: Scenario, numbers: Mapping[str, VectorCodec]) -> Sequence[BondArrows]:
    """Return the bonds with published place and force, in the frame of the world."""
    found: list[BondArrows] = []
    for bond in scenario.bonds:
        for place, force in (("pose", "wrench"), ("position", "force")):
            names = BondArrows(f"{bond.motion}/{place}", f"{bond.force}/{force}")
            if {*names} <= numbers.keys() and all(numbers[name].port.frame == "world" for name in names):
                found.append(names)
    return found
