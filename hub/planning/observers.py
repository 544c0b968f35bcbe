"""The choice of observers, the participants that only look, and the reasons for lock-step.

In real time a camera draws at its own rate, and no participant waits for the camera (docs/decisions/0041).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from hub.participant import Device, Stepped
from hub.planning.plan import PlannedParticipant
from schemas.scenario import Connection, Scenario

__all__ = ["with_observers"]


def with_observers(
    scenario: Scenario,
    participants: Mapping[str, Stepped | Device],
    planned: Mapping[str, PlannedParticipant],
    connections: Sequence[Connection],
) -> dict[str, PlannedParticipant]:
    """Return `planned` with every participant that only looks as observer, or with its reason for lock-step.

    `connections` have no wildcards. An observer shares its process with observers alone.
    """
    result = dict(planned)
    for name, made in participants.items():
        if isinstance(made, Stepped) and made.observer:
            reason = next(_lock_step_reasons(scenario, planned, connections, planned[name]), "")
            update = {"lock_step": reason} if reason else {"observer": True}
            result[name] = planned[name].model_copy(update=update)
    hosts = {one.host for one in planned.values()}
    shared = {"hub"} | {one.host for one in result.values() if not one.observer}
    for name, one in result.items():
        if one.observer and one.host in shared:
            host = name
            while host in hosts:
                host += "_"
            hosts.add(host)
            result[name] = one.model_copy(update={"host": host})
    return result


def _lock_step_reasons(
    scenario: Scenario,
    planned: Mapping[str, PlannedParticipant],
    connections: Sequence[Connection],
    one: PlannedParticipant,
) -> Iterator[str]:
    """Yield the reasons for lock-step of a participant that only looks; the ends may not exist."""
    if scenario.pace != "realtime":
        yield f"pace {scenario.pace}"
    if one.bonds:
        yield "it has a bond"
    follows = False
    for connection in connections:
        source, target = (planned.get(end.participant) for end in (connection.source, connection.target))
        if source is one and target is not None and (target.role != "device" or target.simulated_time):
            yield f"it feeds {connection.target}"
        if target is not one:
            continue
        if source is not None and source.role == "device":
            yield f"it reads {connection.source}, a device"
        port = next((port for port in one.ports if port.name == connection.target.port), None)
        if port is not None and port.variability == "event":
            yield f"it takes every message of {connection.source}"
        if connection.extrapolation == "linear":
            yield f"it extrapolates {connection.source}"
        follows = True
    if not follows:
        yield "it has no input that it could follow"
