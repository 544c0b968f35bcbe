"""Scripted policies for the exercises, from the observation alone, in actions of an environment.

The policies show that an exercise can be done within its steps, and give demonstrations to learn from.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from learning.environments.environment import Environment
from learning.environments.oracles import needles, others, rings, tissue
from learning.environments.oracles.waypoints import Oracle, WaypointPlan

__all__ = ["ORACLES", "Oracle", "oracle"]

ORACLES: Mapping[str, Callable[[Environment], WaypointPlan]] = MappingProxyType(
    {
        "Reach": others.reach,
        "NeedlePick": needles.needle_pick,
        "NeedleHandOver": needles.hand_over,
        "PegTransfer": rings.peg_transfer,
        "TwoHandedPegTransfer": rings.bi_peg_transfer,
        "PickAndPlace": others.piece,
        "Retraction": others.retraction,
        "Dissect": tissue.dissect,
        "TissueCut": tissue.tissue_cut,
    }
)
"""Plans, by the class of their exercise."""


def oracle(env: Environment) -> Oracle:
    """Return the policy of an environment for an episode, called with each observation."""
    return Oracle(env, ORACLES[type(env.exercise).__name__])
