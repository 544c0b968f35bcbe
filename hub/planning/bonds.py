"""The bonds of a session: checked as declared, and again with the numbers known after `configure`."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence

from hub.participant import Device, Stepped
from hub.planning.coupling import stable_step_problem
from hub.planning.plan import Plan, PlannedBond
from schemas.errors import ScenarioError, did_you_mean
from schemas.ports import BondSide
from schemas.scenario import Bond, PortReference, Scenario

__all__ = ["check_bonds", "plan_bond"]

log = logging.getLogger(__name__)


def plan_bond(scenario: Scenario, participants: Mapping[str, Stepped | Device], index: int) -> PlannedBond:
    """Return the bond at `index` with the two sides declared by the participants.

    Raises ScenarioError if a side is missing, the sides do not fit, or the algorithm needs more.
    """
    bond, path = scenario.bonds[index], ("bonds", index)
    motion = _bond_side(participants, bond.motion, "motion", (*path, "motion"))
    force = _bond_side(participants, bond.force, "force", (*path, "force"))
    if motion.dof != force.dof:
        problem = f"'{bond.motion}' has {motion.dof} degrees of freedom, '{bond.force}' has {force.dof}"
        raise ScenarioError(problem, path=path)
    if motion.dof < 6 and motion.coordinate != force.coordinate:
        problem = f"'{bond.motion}' moves by {motion.coordinate}, '{bond.force}' by {force.coordinate}"
        raise ScenarioError(problem, path=path)
    if motion.points != force.points:
        problem = (
            f"'{bond.motion}' bonds {motion.points} points, '{bond.force}' bonds {force.points}: both need"
            " as many, so change the number on either side (`spheres` of a tissue's probe)"
        )
        raise ScenarioError(problem, path=path)
    if motion.frame and force.frame and motion.frame != force.frame:
        problem = f"'{bond.motion}' is in frame '{motion.frame}', '{bond.force}' in frame '{force.frame}'"
        raise ScenarioError(problem, path=path)
    if problem := _algorithm_problem(bond, force) or _period_problem(scenario, bond):
        raise ScenarioError(problem, path=path)
    return PlannedBond(bond=bond, motion=motion, force=force)


def _bond_side(
    participants: Mapping[str, Stepped | Device], end: PortReference, side: str, path: tuple[str | int, ...]
) -> BondSide:
    participant = participants.get(end.participant)
    if participant is None:
        hint = did_you_mean(end.participant, participants)
        raise ScenarioError(f"unknown participant '{end.participant}'.{hint}", path=path)
    declared = {one.name: one for one in participant.bonds} if isinstance(participant, Stepped) else {}
    if end.port not in declared:
        hint = did_you_mean(end.port, declared)
        raise ScenarioError(f"participant '{end.participant}' has no bond '{end.port}'.{hint}", path=path)
    found = declared[end.port]
    if found.side != side:
        raise ScenarioError(f"'{end}' is a {found.side} side, expected a {side} side", path=path)
    return found


def _algorithm_problem(bond: Bond, force: BondSide) -> str | None:
    names = sorted({bond.motion.participant, bond.force.participant})
    if bond.algorithm == "gauss-seidel" and sorted(bond.order or ()) != names:
        return f"gauss-seidel needs the order of its two participants, such as 'order: [{', '.join(names)}]'"
    if bond.algorithm == "impulse-linearised" and None in (force.stiffness, force.damping, force.proxy_mass):
        return (
            f"impulse-linearised needs stiffness, damping and proxy mass, which '{bond.force}' does not state"
        )
    return None


def _period_problem(scenario: Scenario, bond: Bond) -> str | None:
    motion, force = (
        scenario.participants[end.participant].period or scenario.step for end in (bond.motion, bond.force)
    )
    return "the force side's period must be a multiple of the motion side's" if force % motion else None


def check_bonds(plan: Plan, bonds: Mapping[str, Sequence[BondSide]]) -> None:
    """Check the stable-step rule of every bond.

    Args:
        plan: The session's plan.
        bonds: Bond sides of each participant as declared after `configure`, with effective masses.

    Raises:
        ScenarioError: A rule is broken; a bond with `check: warn` logs a warning instead.
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
