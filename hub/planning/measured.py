"""The measured output ports of a scenario."""

from __future__ import annotations

from collections.abc import Mapping

from hub.planning.plan import PlannedParticipant
from schemas.errors import ScenarioError, did_you_mean
from schemas.ports import Port
from schemas.ros import Float64Message
from schemas.scenario import Scenario
from schemas.vectors import VectorCodec, has_vector

__all__ = ["check_measures", "measured_port"]


def check_measures(scenario: Scenario, participants: Mapping[str, PlannedParticipant]) -> None:
    """Raise ScenarioError if a measure names a missing output or field."""
    for name, measure in scenario.measure.items():
        path, of = ("measure", name, "of"), measure.of
        if of.participant not in participants:
            hint = did_you_mean(of.participant, participants)
            raise ScenarioError(f"unknown participant '{of.participant}'.{hint}", path=path)
        port, _ = measured_port(participants[of.participant], of.port, path)
        if measure.kind == "time-above" and port.variability == "event":
            problem = f"'{of}' has no value between its events: time-above is measured of a signal"
            raise ScenarioError(problem, path=path)


def measured_port(
    planned: PlannedParticipant, text: str, path: tuple[str | int, ...] = ()
) -> tuple[Port, slice]:
    """Return the output port and the part of the vector named by `port` or `port.field`.

    Raises ScenarioError, about `path`, if there is no such output with a vector form, or no such field. An
    event port is measured if each message is a single number; the sizes of larger messages may change.
    """
    outputs = {
        port.name: port
        for port in planned.ports
        if port.causality == "output"
        and (has_vector(port.type) if port.variability == "signal" else port.type == Float64Message.ros_type)
    }
    name, _, field = text.partition(".")
    if name not in outputs:
        hint = did_you_mean(name, outputs)
        problem = f"participant '{planned.name}' has no output '{name}' to measure.{hint}"
        raise ScenarioError(problem, path=path)
    codec = VectorCodec(outputs[name])
    if field and field not in codec.fields:
        hint = did_you_mean(field, codec.fields)
        raise ScenarioError(f"'{planned.name}.{name}' has no field '{field}'.{hint}", path=path)
    return outputs[name], codec.fields[field] if field else slice(0, codec.size)
