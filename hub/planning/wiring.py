"""The wiring of a session: every port, connection and bond of a scenario checked against what the
participants declare.
"""

from __future__ import annotations

from collections.abc import Mapping

from hub.participant import BondPlan, Device, Stepped
from hub.planning.coupling import bond_plans, is_fresh
from hub.planning.plan import (
    ConnectionFromDevice,
    ConnectionToDevice,
    Plan,
    PlannedBond,
    PlannedConnection,
    PlannedParticipant,
    has_simulated_time,
)
from hub.planning.wildcard import spelt_out
from schemas.errors import ScenarioError, did_you_mean
from schemas.ports import BondSide, Port, bond_ports
from schemas.quantity import same_unit
from schemas.scenario import Bond, Connection, PortReference, Scenario
from schemas.vectors import VectorCodec, has_vector

__all__ = ["make_plan", "measured_port"]

Path = tuple[str | int, ...]

_LEAST_READ_NS = 100_000
"""A loop in Python that is asked for more keeps a core busy for nothing."""


def make_plan(
    scenario: Scenario, participants: Mapping[str, Stepped | Device], roles: Mapping[str, str]
) -> Plan:
    """Check the wiring of `scenario` against what its `participants` declare.

    Raises ScenarioError, with the place in the scenario, on the first thing that does not fit.
    """
    bonds = [_planned_bond(scenario, participants, i) for i in range(len(scenario.bonds))]
    planned = {
        name: _planned(scenario, participants[name], roles[name], bonds) for name in scenario.participants
    }
    wiring = _Wiring(scenario, planned)
    ports = {name: one.ports for name, one in planned.items()}
    for index, connection in enumerate(scenario.connections):
        for single in spelt_out(connection, ports, ("connections", index)):
            wiring.connect(single, ("connections", index))
    for index, bond in enumerate(bonds):
        wiring.couple(index, bond)
    wiring.check_inputs()
    _check_measures(scenario, planned)
    return Plan(
        step_ns=scenario.step,
        order=wiring.step_order(),
        participants=planned,
        connections=tuple(wiring.connections),
        from_devices=tuple(wiring.from_devices),
        to_devices=tuple(wiring.to_devices),
        bonds=tuple(bonds),
    )


def _planned(
    scenario: Scenario, participant: Stepped | Device, role: str, bonds: list[PlannedBond]
) -> PlannedParticipant:
    name = participant.name
    spec, path = scenario.participants[name], ("participants", name)
    sides = [
        (b.bond, s)
        for b in bonds
        for e, s in ((b.bond.motion, b.motion), (b.bond.force, b.force))
        if e.participant == name
    ]
    ports = participant.ports + tuple(port for _, side in sides for port in bond_ports(side))
    in_wall_time = role == "device" and not has_simulated_time(ports)
    period_ns = spec.period if spec.period is not None and not in_wall_time else scenario.step
    read_ns = (
        (spec.period if spec.period is not None else participant.read_period_ns)
        if in_wall_time and isinstance(participant, Device)
        else 0
    )
    if period_ns <= 0 or period_ns % scenario.step:
        raise ScenarioError(
            f"period {period_ns / 1e6:g} ms is no multiple of the step {scenario.step / 1e6:g} ms",
            path=(*path, "period"),
        )
    if in_wall_time and read_ns < _LEAST_READ_NS:
        raise ScenarioError(
            f"period {read_ns / 1e6:g} ms: a device is read every {_LEAST_READ_NS / 1e6:g} ms at most",
            path=(*path, "period"),
        )
    if spec.network_link is not None and role != "device":
        raise ScenarioError(
            f"a network link lies between a device and the hub, but '{name}' is a {role}: leave it out",
            path=(*path, "network_link"),
        )
    for port in ports:
        if port.period_ns % period_ns and not in_wall_time:
            problem = (
                f"output '{port.name}' has a period of {port.period_ns / 1e6:g} ms, no multiple of the"
                f" participant's {period_ns / 1e6:g} ms"
            )
            raise ScenarioError(problem, path=path)
    plans: dict[str, BondPlan] = {}
    for planned in bonds:
        motion, force = bond_plans(planned.bond, planned.force, period_ns / 1e9)
        if planned.bond.motion.participant == name:
            plans[planned.motion.name] = motion
        if planned.bond.force.participant == name:
            plans[planned.force.name] = force
    planned = PlannedParticipant(
        name=name,
        kind=spec.kind,
        role=role,  # pyright: ignore[reportArgumentType]
        host=f"remote/{name}" if spec.host == "remote" else spec.host,
        period=period_ns // scenario.step,
        read_ns=read_ns,
        network_link=spec.network_link,
        rate_limit=spec.rate_limit,
        ports=ports,
        bonds=tuple(side for _, side in sides),
        bond_plans=plans,
    )
    if planned.simulated_time and planned.host != "hub":
        raise ScenarioError(
            f"device '{name}' plays in simulated time, which only the hub's process has: leave out its host",
            path=(*path, "host"),
        )
    return planned


def _planned_bond(
    scenario: Scenario, participants: Mapping[str, Stepped | Device], index: int
) -> PlannedBond:
    bond = scenario.bonds[index]
    sides: list[BondSide] = []
    for word, end in (("motion", bond.motion), ("force", bond.force)):
        path = ("bonds", index, word)
        participant = participants.get(end.participant)
        if participant is None:
            raise ScenarioError(
                f"unknown participant '{end.participant}'.{did_you_mean(end.participant, participants)}",
                path=path,
            )
        declared = {side.name: side for side in participant.bonds} if isinstance(participant, Stepped) else {}
        if end.port not in declared:
            raise ScenarioError(
                f"participant '{end.participant}' has no bond"
                f" '{end.port}'.{did_you_mean(end.port, declared)}",
                path=path,
            )
        side = declared[end.port]
        if side.side != word:
            raise ScenarioError(f"'{end}' is a {side.side} side, here the {word} side is wanted", path=path)
        sides.append(side)
    motion, force = sides
    if motion.dof != force.dof:
        raise ScenarioError(
            f"'{bond.motion}' has {motion.dof} degrees of freedom, '{bond.force}' has {force.dof}",
            path=("bonds", index),
        )
    if motion.points != force.points:
        raise ScenarioError(
            f"'{bond.motion}' bonds {motion.points} points, '{bond.force}' bonds {force.points}",
            path=("bonds", index),
        )
    if motion.frame and force.frame and motion.frame != force.frame:
        raise ScenarioError(
            f"'{bond.motion}' is in frame '{motion.frame}', '{bond.force}' in frame '{force.frame}'",
            path=("bonds", index),
        )
    _check_algorithm(scenario, bond, force, index)
    return PlannedBond(bond=bond, motion=motion, force=force)


def _check_algorithm(scenario: Scenario, bond: Bond, force: BondSide, index: int) -> None:
    names = {bond.motion.participant, bond.force.participant}
    if bond.algorithm == "gauss-seidel" and (
        bond.order is None or set(bond.order) != names or len(bond.order) != 2
    ):
        raise ScenarioError(
            "gauss-seidel needs the order of its two participants, such as 'order:"
            f" [{', '.join(sorted(names))}]'",
            path=("bonds", index),
        )
    if bond.algorithm == "impulse-linearised" and None in (force.stiffness, force.damping, force.proxy_mass):
        raise ScenarioError(
            f"impulse-linearised needs stiffness, damping and proxy mass, which '{bond.force}' does not"
            " state",
            path=("bonds", index),
        )
    periods = [
        scenario.participants[end.participant].period or scenario.step for end in (bond.motion, bond.force)
    ]
    if periods[1] % periods[0]:
        raise ScenarioError(
            "the force side's period must be a multiple of the motion side's", path=("bonds", index)
        )


class _Wiring:
    """Collects the links of a session while checking them."""

    def __init__(self, scenario: Scenario, participants: Mapping[str, PlannedParticipant]) -> None:
        self._scenario = scenario
        self._planned = participants
        self._fed: dict[tuple[str, str], list[str]] = {}
        self._rank = {name: i for i, name in enumerate(scenario.order or ())}
        self.connections: list[PlannedConnection] = []
        self.from_devices: list[ConnectionFromDevice] = []
        self.to_devices: list[ConnectionToDevice] = []
        for index, name in enumerate(scenario.order or ()):
            if name not in participants or participants[name].role == "device":
                stepped = [n for n, m in participants.items() if m.role != "device"]
                raise ScenarioError(
                    f"unknown stepped participant '{name}'.{did_you_mean(name, stepped)}",
                    path=("order", index),
                )

    def connect(self, connection: Connection, path: Path) -> None:
        source = self._resolve(connection.source, "output", path)
        target = self._resolve(connection.target, "input", path)
        _check_fit(connection.source, source, connection.target, target, path)
        self._feed(connection.target, str(connection.source), path, shared=target.variability == "event")
        one, other = connection.source, connection.target
        if connection.extrapolation == "linear" and (
            target.variability == "event" or not has_vector(target.type)
        ):
            values = f"values of {target.type}" if target.variability == "signal" else "events"
            raise ScenarioError(
                f"{values} cannot be extrapolated, as '{connection.source} -> {connection.target}' would",
                path=path,
            )
        from_device, to_device = (self._planned[end.participant].role == "device" for end in (one, other))
        if to_device and connection.extrapolation == "linear":
            raise ScenarioError(
                f"'{other.participant}' is a device, which is written what is there: 'extrapolation' is for"
                " participants that step",
                path=path,
            )
        if from_device and to_device:
            raise ScenarioError(
                "a device cannot feed a device: only the simulation lies between them", path=path
            )
        if from_device:
            age = min((a for a in (source.max_age_ns, target.max_age_ns) if a), default=0)
            self.from_devices.append(
                ConnectionFromDevice(
                    source=one.participant,
                    source_port=one.port,
                    target=other.participant,
                    target_port=other.port,
                    max_age_ns=age,
                )
            )
        elif self._planned[other.participant].simulated_time:
            self._add(one, other, fresh=False, linear=False)
        elif to_device:
            self.to_devices.append(
                ConnectionToDevice(
                    source=one.participant,
                    source_port=one.port,
                    target=other.participant,
                    target_port=other.port,
                )
            )
        else:
            self._add(
                one,
                other,
                fresh=self._in_order(one.participant, other.participant),
                linear=connection.extrapolation == "linear",
            )

    def couple(self, index: int, planned: PlannedBond) -> None:
        bond = planned.bond
        *moving, force = zip(bond_ports(planned.motion), bond_ports(planned.force), strict=True)
        for here, there in moving:
            self._connect_bond(
                index, _end(bond.motion, here), _end(bond.force, there), fresh=is_fresh(bond, "motion")
            )
        self._connect_bond(
            index, _end(bond.force, force[1]), _end(bond.motion, force[0]), fresh=is_fresh(bond, "force")
        )

    def _connect_bond(self, index: int, one: PortReference, other: PortReference, *, fresh: bool) -> None:
        self._feed(other, str(one), ("bonds", index))
        self._add(one, other, fresh=fresh, linear=False)

    def _add(self, one: PortReference, other: PortReference, *, fresh: bool, linear: bool) -> None:
        self.connections.append(
            PlannedConnection(
                source=one.participant,
                source_port=one.port,
                target=other.participant,
                target_port=other.port,
                fresh=fresh,
                linear=linear,
            )
        )

    def _in_order(self, source: str, target: str) -> bool:
        if self._scenario.algorithm == "jacobi" or source == target:
            return False
        if source in self._rank and target in self._rank:
            return self._rank[source] < self._rank[target]
        return True

    def _resolve(self, end: PortReference, causality: str, path: Path) -> Port:
        planned = self._planned.get(end.participant)
        if planned is None:
            raise ScenarioError(
                f"unknown participant '{end.participant}'.{did_you_mean(end.participant, self._planned)}",
                path=path,
            )
        ports = {port.name: port for port in planned.ports}
        if end.port not in ports:
            allowed = [name for name, port in ports.items() if port.causality == causality]
            raise ScenarioError(
                f"participant '{end.participant}' has no {causality}"
                f" '{end.port}'.{did_you_mean(end.port, allowed)}",
                path=path,
            )
        if ports[end.port].causality != causality:
            raise ScenarioError(
                f"'{end}' is an {ports[end.port].causality}, here an {causality} is wanted", path=path
            )
        return ports[end.port]

    def _feed(self, end: PortReference, source: str, path: Path, *, shared: bool = False) -> None:
        """Note who feeds an input; one that is `shared`, a queue of events, may have several sources."""
        before = self._fed.setdefault((end.participant, end.port), [])
        if before and (not shared or source in before):
            raise ScenarioError(f"input '{end}' is fed twice, by '{before[0]}' and by '{source}'", path=path)
        before.append(source)

    def check_inputs(self) -> None:
        """Refuse an input that has neither a source nor a start value."""
        for name, planned in self._planned.items():
            for port in planned.ports:
                needs = (
                    port.causality == "input"
                    and port.variability == "signal"
                    and port.start is None
                    and planned.role != "device"
                )
                if needs and (name, port.name) not in self._fed:
                    raise ScenarioError(
                        f"input '{name}.{port.name}' ({port.type}) is not connected and has no start value",
                        path=("participants", name),
                    )

    def step_order(self) -> tuple[str, ...]:
        """Return the stepped participants such that every fresh link goes forward; ties as `order` has them,
        then in the scenario's order.
        """
        stepped = sorted(
            (name for name, m in self._planned.items() if m.role != "device"),
            key=lambda name: self._rank.get(name, len(self._rank)),
        )
        waiting = {
            name: {k.source for k in self.connections if k.fresh and k.target == name} for name in stepped
        }
        order: list[str] = []
        while waiting:
            free = next((name for name in waiting if not waiting[name] & waiting.keys()), None)
            if free is None:
                cycle = ", ".join(waiting)
                problem = (
                    f"connections form a cycle among {cycle}: say in which order they step, such as 'order:"
                    f" [{cycle}]', or use 'algorithm: jacobi'"
                )
                raise ScenarioError(problem, path=("order",) if self._scenario.order else ("connections",))
            order.append(free)
            del waiting[free]
        return tuple(order)


def _end(side: PortReference, port: Port) -> PortReference:
    return PortReference(participant=side.participant, port=port.name)


def _check_fit(one: PortReference, source: Port, other: PortReference, target: Port, path: Path) -> None:
    if source.type != target.type:
        raise ScenarioError(f"'{one}' gives {source.type}, '{other}' takes {target.type}", path=path)
    if (source.variability, target.variability) == ("event", "signal"):
        raise ScenarioError(
            f"'{one}' gives events, '{other}' takes a signal, which has a value at all times", path=path
        )
    if not same_unit(source.unit, target.unit):
        raise ScenarioError(f"'{one}' is in '{source.unit}', '{other}' takes '{target.unit}'", path=path)
    if source.frame and target.frame and source.frame != target.frame:
        raise ScenarioError(
            f"'{one}' is in frame '{source.frame}', '{other}' takes frame '{target.frame}'", path=path
        )
    if has_vector(source.type) and source.variability == "signal":
        sizes = VectorCodec(source).size, VectorCodec(target).size
        if sizes[0] != sizes[1] and target.variability == "signal":
            raise ScenarioError(f"'{one}' has {sizes[0]} numbers, '{other}' takes {sizes[1]}", path=path)
        if source.names and target.names and source.names != target.names:
            raise ScenarioError(
                f"'{one}' names {', '.join(source.names)}; '{other}' takes {', '.join(target.names)}",
                path=path,
            )


def _check_measures(scenario: Scenario, participants: Mapping[str, PlannedParticipant]) -> None:
    for name, measure in scenario.measure.items():
        path = ("measure", name, "of")
        planned = participants.get(measure.of.participant)
        if planned is None:
            raise ScenarioError(
                "unknown participant"
                f" '{measure.of.participant}'.{did_you_mean(measure.of.participant, participants)}",
                path=path,
            )
        measured_port(planned, measure.of.port, path)


def measured_port(planned: PlannedParticipant, text: str, path: Path = ()) -> tuple[Port, slice]:
    """Return the output port and the part of its vector that `port` or `port.field` means."""
    outputs = {
        p.name: p
        for p in planned.ports
        if p.causality == "output" and p.variability == "signal" and has_vector(p.type)
    }
    name, _, field = text.partition(".")
    if name not in outputs:
        raise ScenarioError(
            f"participant '{planned.name}' has no output '{name}' to measure.{did_you_mean(name, outputs)}",
            path=path,
        )
    codec = VectorCodec(outputs[name])
    if field and field not in codec.fields:
        raise ScenarioError(
            f"'{planned.name}.{name}' has no field '{field}'.{did_you_mean(field, codec.fields)}", path=path
        )
    return outputs[name], codec.fields[field] if field else slice(0, codec.size)
