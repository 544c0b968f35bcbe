"""Whether the bonds of a session are stable with the numbers that its participants know once they are
configured.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence

from hub.planning.coupling import stable_step_problem
from hub.planning.plan import Plan
from schemas.errors import ScenarioError
from schemas.ports import BondSide

__all__ = ["check_bonds"]

log = logging.getLogger(__name__)


def check_bonds(plan: Plan, bonds: Mapping[str, Sequence[BondSide]]) -> None:
    """Check the stable-step rule of every bond; `bonds` are those of each participant.

    Raises ScenarioError, or warns where the bond says so.
    """
    for index, planned in enumerate(plan.bonds):
        bond = planned.bond
        motion, force = (
            next(s for s in bonds[end.participant] if s.name == end.port) for end in (bond.motion, bond.force)
        )
        step_s = plan.participants[bond.force.participant].period * plan.step_ns / 1e9
        problem = stable_step_problem(bond, motion, force, step_s)
        if problem and bond.check == "refuse":
            raise ScenarioError(
                f"{problem} To run all the same, set 'check: warn' on the bond.", path=("bonds", index)
            )
        if problem:
            log.warning("bond %s: %s", bond.name, problem)
