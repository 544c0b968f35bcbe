"""What the routine sees and feels in a step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np

from controllers.cholecystectomy.obstacles import Obstacles
from controllers.cholecystectomy.params import ClipAndCutParams
from controllers.cholecystectomy.surfaces import Surfaces
from controllers.cholecystectomy.surgeon_hand import SurgeonHand
from controllers.cholecystectomy.tube import Tube
from controllers.expert.reach import LINK_RADII, links
from hub.participant import Inputs
from schemas.trocar_msgs import SoftBodyState, TissueEvent, TubeLine
from schemas.vectors import Vector

__all__ = ["Sight", "nodes_of", "shaft_of"]


class Sight:
    """Lines of the tubes, surfaces of the organs, and the state of the grasp."""

    def __init__(self, params: ClipAndCutParams, inputs: Inputs, surfaces: Surfaces) -> None:
        """`surfaces`: triangles seen so far; those of this step are added."""
        self._params, self._inputs, self._surfaces = params, inputs, surfaces
        for organ in dict.fromkeys((params.gallbladder, *params.avoid)):
            if isinstance(state := inputs.message(f"{organ}/nodes"), SoftBodyState):
                surfaces.see(organ, state)

    @property
    def is_complete(self) -> bool:
        """Whether all organs have been seen."""
        params = self._params
        seen = [f"{tube}/line" for tube in params.tubes]
        seen += [f"{organ}/nodes" for organ in (params.gallbladder, *params.avoid)]
        return all(self._inputs.message(port) is not None for port in seen)

    def tube(self, index: int) -> Tube:
        """Return a tube by its number."""
        return Tube(cast("TubeLine", self._inputs.message(f"{self._params.tubes[index]}/line")))

    def events(self, tube: int) -> tuple[TissueEvent, ...]:
        """Return what has happened to a tube."""
        return cast("tuple[TissueEvent, ...]", self._inputs.events(f"{self._params.tubes[tube]}/events"))

    @property
    def gallbladder(self) -> Vector:
        """Nodes of the gallbladder, m, shape (n, 3)."""
        return nodes_of(self._inputs, self._params.gallbladder)

    @property
    def is_held(self) -> bool:
        """Whether the grasper holds tissue."""
        return float(self._inputs[f"{self._params.grasper}/held"][0]) > 0.0

    @property
    def pull(self) -> float:
        """Force of the grasper on the tissue, N."""
        return float(np.linalg.norm(self._inputs[f"{self._params.grasper}/pull"]))

    @property
    def wall(self) -> Obstacles:
        """Surface of the gallbladder."""
        return self._organ(self._params.gallbladder)

    @property
    def spared(self) -> Obstacles:
        """Organs that scissors never touch."""
        organs = [organ for organ in self._params.avoid if organ != self._params.gallbladder]
        return Obstacles.join([self._organ(organ) for organ in organs])

    def obstacles(self, hand: SurgeonHand, hands: Sequence[SurgeonHand], tube: int | None) -> Obstacles:
        """Return what a hand keeps away from at work on a tube, or, with None, at the gallbladder."""
        params = self._params
        others = [organ for organ in params.avoid if organ not in (params.gallbladder, *params.tubes)]
        parts = [self._organ(organ) for organ in others]
        parts += [] if tube is None else [self.wall]
        parts += [self._line(other) for other in range(len(params.tubes)) if other != tube]
        parts += [shaft_of(other) for other in hands if other is not hand]
        return Obstacles.join(parts)

    def _organ(self, name: str) -> Obstacles:
        return self._surfaces.obstacles(name, nodes_of(self._inputs, name))

    def _line(self, index: int) -> Obstacles:
        return self.tube(index).body


def nodes_of(inputs: Inputs, organ: str) -> Vector:
    """Return the nodes of an organ, m, shape (n, 3)."""
    state = cast("SoftBodyState", inputs.message(f"{organ}/nodes"))
    return state.nodes_m.astype(np.float64).reshape(-1, 3)


def shaft_of(hand: SurgeonHand) -> Obstacles:
    """Return wrist and shaft of a hand's instrument, for others to keep away from."""
    return Obstacles.points(links(hand.chain, hand.base, hand.joints[None])[0], LINK_RADII)
