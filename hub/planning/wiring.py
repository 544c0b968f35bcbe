"""The plan of a scenario: connections, bonds and measures checked against the participants' declarations."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping

from hub.participant import Device, Stepped
from hub.planning.bonds import plan_bond
from hub.planning.connections import Connections
from hub.planning.measured import check_measures
from hub.planning.observers import with_observers
from hub.planning.participants import plan_participant
from hub.planning.plan import Plan, PlannedBond
from hub.planning.registry import Role
from hub.planning.step_order import check_order, step_order
from hub.planning.wildcard import expand_wildcard
from schemas.scenario import Scenario

__all__ = ["make_plan"]


def make_plan(
    scenario: Scenario, participants: Mapping[str, Stepped | Device], roles: Mapping[str, Role]
) -> Plan:
    """Return the plan of `scenario` for `participants`, not necessarily configured or open yet.

    Raises ScenarioError, with the place in the scenario, about the first mismatch.
    """
    bonds = [plan_bond(scenario, participants, index) for index in range(len(scenario.bonds))]
    own: defaultdict[str, list[PlannedBond]] = defaultdict(list)
    for one in bonds:
        for name in dict.fromkeys((one.bond.motion.participant, one.bond.force.participant)):
            own[name].append(one)
    planned = {
        name: plan_participant(scenario, participants[name], roles[name], own[name])
        for name in scenario.participants
    }
    check_order(scenario, planned)
    ports = {name: one.ports for name, one in planned.items()}
    singles = [
        (single, ("connections", index))
        for index, connection in enumerate(scenario.connections)
        for single in expand_wildcard(connection, ports, ("connections", index))
    ]
    planned = with_observers(scenario, participants, planned, [single for single, _ in singles])
    connections = Connections(scenario, planned)
    for single, path in singles:
        connections.connect(single, path)
    for index, bond in enumerate(bonds):
        connections.connect_bond(index, bond)
    connections.check_inputs()
    check_measures(scenario, planned)
    return Plan(
        step_ns=scenario.step,
        order=step_order(scenario, planned, connections.stepped),
        participants=planned,
        connections=tuple(connections.stepped),
        from_devices=tuple(connections.from_devices),
        to_devices=tuple(connections.to_devices),
        bonds=tuple(bonds),
    )
