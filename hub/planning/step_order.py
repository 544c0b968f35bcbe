"""The step order of the participants of a session."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from heapq import heappop, heappush

from hub.planning.plan import PlannedConnection, PlannedParticipant
from schemas.errors import ScenarioError, did_you_mean
from schemas.scenario import Scenario

__all__ = ["check_order", "reads_this_step", "step_order"]


def check_order(scenario: Scenario, participants: Mapping[str, PlannedParticipant]) -> None:
    """Raise ScenarioError if the scenario's `order` names no participant.

    A device in `order` does not step: the name stands for the controller replaced by the device.
    """
    stepped = {name: None for name, planned in participants.items() if planned.role != "device"}
    for index, name in enumerate(scenario.order or ()):
        if name not in participants:
            problem = f"unknown stepped participant '{name}'.{did_you_mean(name, stepped)}"
            raise ScenarioError(problem, path=("order", index))


def reads_this_step(scenario: Scenario, rank: Mapping[str, int], source: str, target: str) -> bool:
    """Return whether `target` reads the output of `source` of the same step, not of the step before.

    `rank` is the place of each participant in the scenario's `order`.
    """
    if scenario.algorithm == "jacobi" or source == target:
        return False
    if source in rank and target in rank:
        return rank[source] < rank[target]
    return True


def step_order(
    scenario: Scenario,
    participants: Mapping[str, PlannedParticipant],
    connections: Sequence[PlannedConnection],
) -> tuple[str, ...]:
    """Return the participants in lock-step in an order with every fresh connection leading forward.

    Where the connections leave a choice, the scenario's `order` decides, then the order of the participants.
    Raises ScenarioError if fresh connections form a cycle.
    """
    rank = {name: index for index, name in enumerate(scenario.order or ())}
    stepped = sorted(
        (name for name, planned in participants.items() if planned.in_step),
        key=lambda name: rank.get(name, len(rank)),
    )
    place = {name: index for index, name in enumerate(stepped)}
    sources: dict[str, set[str]] = {name: set() for name in stepped}
    targets: dict[str, set[str]] = {name: set() for name in stepped}
    for connection in connections:
        if connection.fresh and connection.source in place and connection.target in place:
            sources[connection.target].add(connection.source)
            targets[connection.source].add(connection.target)
    free = [place[name] for name in stepped if not sources[name]]  # in order, so a heap
    order: list[str] = []
    while free:
        name = stepped[heappop(free)]
        order.append(name)
        for target in targets[name]:
            sources[target].remove(name)
            if not sources[target]:
                heappush(free, place[target])
    if len(order) < len(stepped):
        cycle = ", ".join(name for name in stepped if sources[name])
        raise ScenarioError(
            f"connections form a cycle among {cycle}: state the order in which they step, such as 'order:"
            f" [{cycle}]', or use 'algorithm: jacobi'",
            path=("order",) if scenario.order else ("connections",),
        )
    return tuple(order)
