"""The connections of a session, including connections of bonds, resolved to ports and checked."""

from __future__ import annotations

from collections.abc import Mapping

from hub.planning.coupling import is_fresh
from hub.planning.fit import describe_misfit
from hub.planning.plan import (
    ConnectionFromDevice,
    ConnectionToDevice,
    PlannedBond,
    PlannedConnection,
    PlannedParticipant,
)
from hub.planning.step_order import reads_this_step
from schemas.errors import ScenarioError, did_you_mean
from schemas.ports import Port, bond_ports
from schemas.scenario import Connection, PortReference, Scenario
from schemas.vectors import has_vector

__all__ = ["Connections"]

Path = tuple[str | int, ...]


class Connections:
    """Collects the connections of a session and checks each; every method raises ScenarioError."""

    def __init__(self, scenario: Scenario, participants: Mapping[str, PlannedParticipant]) -> None:
        self._scenario = scenario
        self._participants = participants
        self._rank: dict[str, int] = {}
        """The place of each participant in the scenario's `order`."""
        for index, name in enumerate(scenario.order or ()):
            self._rank.setdefault(name, index)
        self._ports = {name: {port.name: port for port in one.ports} for name, one in participants.items()}
        self._sources: dict[tuple[str, str], list[str]] = {}
        """Sources of each input, keyed by participant and input port."""
        self.stepped: list[PlannedConnection] = []
        self.from_devices: list[ConnectionFromDevice] = []
        self.to_devices: list[ConnectionToDevice] = []

    def connect(self, connection: Connection, path: Path) -> None:
        """Add a connection without a wildcard, at `path` in the scenario."""
        one, other = connection.source, connection.target
        source, target = self._port(one, "output", path), self._port(other, "input", path)
        if problem := describe_misfit(one, source, other, target):
            raise ScenarioError(problem, path=path)
        # a queue of events may have several sources
        self._feed(other, str(one), path, shared=target.variability == "event")
        sender, receiver = self._participants[one.participant], self._participants[other.participant]
        if connection.extrapolation == "linear":
            _check_extrapolation(connection, target, receiver, path)
        if sender.role == receiver.role == "device":
            problem = "a device cannot feed a device: connect both to the simulation between them"
            raise ScenarioError(problem, path=path)
        ends = _ends(one, other)
        if sender.role == "device":
            age = min((age for age in (source.max_age_ns, target.max_age_ns) if age), default=0)
            self.from_devices.append(ConnectionFromDevice(**ends, max_age_ns=age))
        elif receiver.simulated_time:
            self.stepped.append(PlannedConnection(**ends, fresh=False, linear=False))
        elif receiver.role == "device" or receiver.observer:
            self.to_devices.append(ConnectionToDevice(**ends))
        else:
            fresh = reads_this_step(self._scenario, self._rank, one.participant, other.participant)
            linear = connection.extrapolation == "linear"
            self.stepped.append(PlannedConnection(**ends, fresh=fresh, linear=linear))

    def connect_bond(self, index: int, planned: PlannedBond) -> None:
        """Add the connections of the bond at `index`: motion in one direction, force in the other."""
        bond = planned.bond
        *motion, force = zip(bond_ports(planned.motion), bond_ports(planned.force), strict=True)
        for here, there in motion:
            source, target = _end(bond.motion, here), _end(bond.force, there)
            self._couple_sides(source, target, index, fresh=is_fresh(bond, "motion"))
        source, target = _end(bond.force, force[1]), _end(bond.motion, force[0])
        self._couple_sides(source, target, index, fresh=is_fresh(bond, "force"))

    def _couple_sides(self, source: PortReference, target: PortReference, index: int, *, fresh: bool) -> None:
        self._feed(target, str(source), ("bonds", index))
        self.stepped.append(PlannedConnection(**_ends(source, target), fresh=fresh, linear=False))

    def check_inputs(self) -> None:
        """Reject a signal input of a stepped participant without a source and without a start value."""
        for name, planned in self._participants.items():
            for port in planned.ports if planned.role != "device" else ():
                needs_source = (port.causality, port.variability, port.start) == ("input", "signal", None)
                if needs_source and (name, port.name) not in self._sources:
                    raise ScenarioError(
                        f"input '{name}.{port.name}' ({port.type}) is not connected and has no start value",
                        path=("participants", name),
                    )

    def _port(self, end: PortReference, causality: str, path: Path) -> Port:
        planned = self._participants.get(end.participant)
        if planned is None:
            hint = did_you_mean(end.participant, self._participants)
            raise ScenarioError(f"unknown participant '{end.participant}'.{hint}", path=path)
        ports = self._ports[end.participant]
        if end.port not in ports:
            hint = did_you_mean(end.port, [name for name, p in ports.items() if p.causality == causality])
            problem = f"participant '{end.participant}' has no {causality} '{end.port}'.{hint}"
            raise ScenarioError(problem, path=path)
        port = ports[end.port]
        if port.causality != causality:
            raise ScenarioError(f"'{end}' is an {port.causality}, expected an {causality}", path=path)
        return port

    def _feed(self, end: PortReference, source: str, path: Path, *, shared: bool = False) -> None:
        """Note the source of an input; a `shared` input may have several different sources."""
        before = self._sources.setdefault((end.participant, end.port), [])
        if before and (not shared or source in before):
            raise ScenarioError(f"input '{end}' is fed twice, by '{before[0]}' and by '{source}'", path=path)
        before.append(source)


def _check_extrapolation(
    connection: Connection, target: Port, receiver: PlannedParticipant, path: Path
) -> None:
    if target.variability == "event" or not has_vector(target.type):
        values = f"values of {target.type}" if target.variability == "signal" else "events"
        raise ScenarioError(
            f"{values} cannot be extrapolated, as '{connection.source} -> {connection.target}' would",
            path=path,
        )
    if receiver.role == "device":
        raise ScenarioError(
            f"'{receiver.name}' is a device, which receives values as they are: 'extrapolation' is for"
            " participants that step",
            path=path,
        )


def _end(side: PortReference, port: Port) -> PortReference:
    return PortReference(participant=side.participant, port=port.name)


def _ends(source: PortReference, target: PortReference) -> dict[str, str]:
    return {
        "source": source.participant,
        "source_port": source.port,
        "target": target.participant,
        "target_port": target.port,
    }
