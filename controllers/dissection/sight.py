"""What the dissection routine sees and feels in a step."""

from __future__ import annotations

from typing import cast

import numpy as np

from controllers.cholecystectomy.obstacles import Obstacles
from controllers.cholecystectomy.sight import nodes_of
from controllers.dissection.params import DissectionParams
from hub.participant import Inputs
from schemas.plain_sum import plain_sum
from schemas.trocar_msgs import SoftBodyState, TiedPlaces
from schemas.vectors import Vector

__all__ = ["Sight"]

_FREE = 0.95
"""Share of a lower third that counts as all."""


class Sight:
    """Places that are still tied, nodes of the organs, state of the grasp, and heat given."""

    def __init__(self, params: DissectionParams, inputs: Inputs) -> None:
        self._params, self._inputs = params, inputs

    @property
    def is_complete(self) -> bool:
        """Whether all organs have been seen."""
        organs = (self._params.gallbladder, *self._params.avoid)
        ports = (f"{self._params.plate}/ties", *(f"{organ}/nodes" for organ in organs))
        return all(self._inputs.message(port) is not None for port in ports)

    @property
    def plate(self) -> Vector:
        """Places where the plate is still tied, m, shape (n, 3)."""
        message = cast("TiedPlaces", self._inputs.message(f"{self._params.plate}/ties"))
        return message.points_m.reshape(-1, 3)

    @property
    def fat(self) -> Vector:
        """Places where fat is still tied, m, shape (n, 3)."""
        points = [message.points_m.reshape(-1, 3) for message in self._fat_ties]
        return np.concatenate([np.zeros((0, 3)), *points])

    @property
    def fat_area(self) -> float:
        """Area where fat is still tied, m^2."""
        return plain_sum(float(message.areas_m2.sum()) for message in self._fat_ties)

    @property
    def _fat_ties(self) -> list[TiedPlaces]:
        found = [self._inputs.message(f"{name}/ties") for name in self._params.fat]
        return [message for message in found if isinstance(message, TiedPlaces)]

    @property
    def sheet(self) -> Vector:
        """Nodes of the fat, m, shape (n, 3); none without fat."""
        return self._nodes(self._params.sheet)

    @property
    def spared(self) -> Vector:
        """Nodes of the organs near which there is no power, m, shape (n, 3)."""
        return np.concatenate([np.zeros((0, 3)), *map(self._nodes, self._params.spare)])

    def _nodes(self, organ: str) -> Vector:
        port = f"{organ}/nodes"
        is_seen = isinstance(self._inputs.message(port), SoftBodyState)
        return nodes_of(self._inputs, organ) if is_seen else np.zeros((0, 3))

    @property
    def is_free(self) -> bool:
        """Whether the part of the plate that is to be divided has parted."""
        if self._params.part == "all":
            return not len(self.plate)
        return float(self._inputs[f"{self._params.plate}/lower_third"][0]) >= _FREE

    @property
    def gallbladder(self) -> Vector:
        """Nodes of the gallbladder, m, shape (n, 3)."""
        return nodes_of(self._inputs, self._params.gallbladder)

    @property
    def obstacles(self) -> Obstacles:
        """Organs that the shaft of the hook keeps away from."""
        nodes = [nodes_of(self._inputs, organ) for organ in self._params.avoid]
        return Obstacles.join([Obstacles.points(own, np.zeros(len(own))) for own in nodes])

    @property
    def organs(self) -> Vector:
        """Nodes of the organs that the shaft of the hook keeps away from, m, shape (n, 3)."""
        return np.concatenate([np.zeros((0, 3)), *map(self._nodes, self._params.avoid)])

    @property
    def is_held(self) -> bool:
        """Whether the grasper holds tissue."""
        return float(self._inputs[f"{self._params.grasper}/held"][0]) > 0.0

    @property
    def pull(self) -> float:
        """Force of the grasper on the tissue, N."""
        return float(np.linalg.norm(self._inputs[f"{self._params.grasper}/pull"]))

    @property
    def delivered(self) -> float:
        """Heat that the hook has given to tissue, J."""
        return float(self._inputs[f"{self._params.hook}/delivered"][0])
