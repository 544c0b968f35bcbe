"""The order in which the participants of a session step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from hub.planning.plan import PlannedConnection, PlannedParticipant
from schemas.errors import ScenarioError, did_you_mean
from schemas.scenario import Scenario

__all__ = ["check_order", "reads_this_step", "step_order"]


def check_order(scenario: Scenario, participants: Mapping[str, PlannedParticipant]) -> None:
    """Raise ScenarioError if the scenario's `order` names something that does not step."""
    stepped = [name for name, planned in participants.items() if planned.role != "device"]
    for index, name in enumerate(scenario.order or ()):
        if name not in stepped:
            problem = f"unknown stepped participant '{name}'.{did_you_mean(name, stepped)}"
            raise ScenarioError(problem, path=("order", index))


def reads_this_step(scenario: Scenario, source: str, target: str) -> bool:
    """Return whether `target` reads the output of `source` of the same step, not of the step before."""
    if scenario.algorithm == "jacobi" or source == target:
        return False
    order = scenario.order or []
    if source in order and target in order:
        return order.index(source) < order.index(target)
    return True


def step_order(
    scenario: Scenario,
    participants: Mapping[str, PlannedParticipant],
    connections: Sequence[PlannedConnection],
) -> tuple[str, ...]:
    """Return the stepped participants in an order in which every fresh connection leads forward.

    Where the connections leave a choice, the scenario's `order` decides, then the order of its participants.
    Raises ScenarioError if fresh connections form a cycle.
    """
    rank = {name: index for index, name in enumerate(scenario.order or ())}
    stepped = sorted(
        (name for name, planned in participants.items() if planned.role != "device"),
        key=lambda name: rank.get(name, len(rank)),
    )
    waiting = {name: {c.source for c in connections if c.fresh and c.target == name} for name in stepped}
    order: list[str] = []
    while waiting:
        free = next((name for name in waiting if not waiting[name] & waiting.keys()), None)
        if free is None:
            cycle = ", ".join(waiting)
            raise ScenarioError(
                f"connections form a cycle among {cycle}: state the order in which they step, such as 'order:"
                f" [{cycle}]', or use 'algorithm: jacobi'",
                path=("order",) if scenario.order else ("connections",),
            )
        order.append(free)
        del waiting[free]
    return tuple(order)
