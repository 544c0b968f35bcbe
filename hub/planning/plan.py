"""The plan of a session: the place and period of every participant, and every connection and bond."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

from pydantic import BaseModel, ConfigDict, Field, model_validator

from hub.participant import BondPlan
from hub.planning.registry import Role
from hub.planning.renamed import current_plan
from schemas.network_link import NetworkLinkSpec
from schemas.ports import BondSide, Port
from schemas.scenario import Bond

__all__ = [
    "ConnectionFromDevice",
    "ConnectionToDevice",
    "Plan",
    "PlannedBond",
    "PlannedConnection",
    "PlannedParticipant",
    "has_simulated_time",
]


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class PlannedParticipant(_Part):
    """A participant: host, period, and ports, including the ports of its connected bonds."""

    name: str
    kind: str
    role: Role
    host: str
    """`hub`, the name of a process, or `remote/<participant>`."""
    period: int = Field(gt=0)
    """Period in communication steps; 1 for a device in wall time."""
    read_ns: int = 0
    """For a device in wall time: the time between two reads."""
    use_ns: int = 0
    """For a device in wall time: the time between two uses of its signals; 0: every value is used."""
    network_link: NetworkLinkSpec | None = None
    """For a device: the emulated network between device and hub."""
    rate_limit: float = 2000.0
    """For a device: messages per second accepted on each port."""
    observer: bool = False
    """The participant only looks, in its own time: it has no place in the order and is never waited for."""
    lock_step: str = ""
    """Reason for lock-step of a participant that only looks, in words; empty for all others."""
    integration: str = ""
    """How an engine integrates its equations, in words, where its kind leaves a choice."""
    ports: tuple[Port, ...]
    bonds: tuple[BondSide, ...] = ()
    bond_plans: dict[str, BondPlan] = {}

    def port(self, name: str) -> Port:
        """Return the port called `name`."""
        return next(port for port in self.ports if port.name == name)

    @property
    def simulated_time(self) -> bool:
        """Whether the participant is a device in simulated time; any other device lives in wall time."""
        return self.role == "device" and has_simulated_time(self.ports)

    @property
    def in_step(self) -> bool:
        """Whether this is an engine or a controller in lock-step: all but devices and observers."""
        return self.role != "device" and not self.observer

    @property
    def key_role(self) -> str:
        """The role in keys, where every stepped participant is an engine."""
        return "device" if self.role == "device" else "engine"


class PlannedConnection(_Part):
    """A connection from a stepped participant to another participant, or to a device in simulated time."""

    source: str
    source_port: str
    target: str
    target_port: str
    fresh: bool
    """The target reads the output of the same step; otherwise the output of the last communication point."""
    linear: bool
    """The target extrapolates inside the target's step."""


class ConnectionFromDevice(_Part):
    """A connection from a device, through an inlet, to a stepped participant."""

    source: str
    source_port: str
    target: str
    target_port: str
    max_age_ns: int


class ConnectionToDevice(_Part):
    """A connection from a stepped participant to a device in wall time, or to an observer."""

    source: str
    source_port: str
    target: str
    target_port: str


class PlannedBond(_Part):
    """A bond and the two declared sides."""

    bond: Bond
    motion: BondSide
    force: BondSide


class Plan(_Part):
    """The plan of a session, complete for hosts."""

    step_ns: int = Field(gt=0)
    order: tuple[str, ...]
    """The participants in lock-step, in the order of stepping."""
    participants: dict[str, PlannedParticipant]
    connections: tuple[PlannedConnection, ...]
    from_devices: tuple[ConnectionFromDevice, ...]
    to_devices: tuple[ConnectionToDevice, ...]
    bonds: tuple[PlannedBond, ...]

    @model_validator(mode="before")
    @classmethod
    def _with_current_names(cls, data: Any) -> Any:
        """Accept the plan of a recording of version 0.1.0."""
        try:
            return current_plan(cast("dict[str, Any]", data)) if isinstance(data, dict) else data
        except (AttributeError, KeyError, TypeError) as error:
            raise ValueError(f"not a plan ({type(error).__name__}: {error})") from error

    def find_contradiction(self) -> str:
        """Return the first reference of a plan of unknown origin to a missing part; empty if nothing."""
        if any(name != planned.name for name, planned in self.participants.items()):
            return "a participant has two names"
        if sorted(self.order) != sorted(
            name for name, planned in self.participants.items() if planned.in_step
        ):
            return "its order is not that of its engines and controllers"
        ports = {(name, port.name) for name, planned in self.participants.items() for port in planned.ports}
        for one in (*self.connections, *self.from_devices, *self.to_devices):
            if not {(one.source, one.source_port), (one.target, one.target_port)} <= ports:
                return "a connection has an end that is no port"
        for one in self.bonds:
            if not {one.bond.motion.participant, one.bond.force.participant} <= self.participants.keys():
                return "a bond has a side without a participant"
        return ""

    def observers(self) -> tuple[PlannedParticipant, ...]:
        """Return the participants that only look, in their own time."""
        return tuple(planned for planned in self.participants.values() if planned.observer)

    def connected_inputs(self, participant: str) -> frozenset[str]:
        """Return the inputs of a participant with a source."""
        every = (*self.connections, *self.from_devices, *self.to_devices)
        return frozenset(one.target_port for one in every if one.target == participant)

    def output_stride(self, participant: str, port: str) -> int:
        """Return how many steps lie between two values of an output port."""
        planned = self.participants[participant]
        return max(planned.period, planned.port(port).period_ns // self.step_ns)

    def exchanging_devices(self) -> tuple[PlannedParticipant, ...]:
        """Return the devices in simulated time with a forced end of a grant in each of their periods.

        These are the devices with inputs, and the devices behind a network link.
        """
        written = {connection.target for connection in self.connections}
        return tuple(
            planned
            for planned in self.participants.values()
            if planned.simulated_time and (planned.name in written or planned.network_link is not None)
        )

    def grant_stop_periods(self) -> list[int]:
        """Return the periods, in steps, with a forced end of a grant at every multiple, in ascending order.

        Inside a grant, no reader of a device may start a step, or the reader would miss the newest samples;
        and no device may be due with inputs from participants of the same grant.
        """
        reading = {self.participants[inlet.target].period for inlet in self.from_devices}
        return sorted(reading | {device.period for device in self.exchanging_devices()})

    def seen_from(self, host: str) -> Plan:
        """Return the part of the plan needed by another machine to run host `host`.

        The part is the host's participants, and of the remaining participants the ports connected to the
        host.
        """
        own = {name for name, planned in self.participants.items() if planned.host == host}
        connections = tuple(k for k in self.connections if {k.source, k.target} & own)
        from_devices = tuple(k for k in self.from_devices if {k.source, k.target} & own)
        to_devices = tuple(k for k in self.to_devices if {k.source, k.target} & own)
        every = (*connections, *from_devices, *to_devices)
        ends = {(k.source, k.source_port) for k in every} | {(k.target, k.target_port) for k in every}
        shared: dict[str, PlannedParticipant] = {}
        for name, planned in self.participants.items():
            ports = tuple(port for port in planned.ports if (name, port.name) in ends)
            if name in own:
                shared[name] = planned
            elif ports:
                shared[name] = planned.model_copy(update={"ports": ports, "bonds": (), "bond_plans": {}})
        return Plan(
            step_ns=self.step_ns,
            order=tuple(name for name in self.order if name in shared),
            participants=shared,
            connections=connections,
            from_devices=from_devices,
            to_devices=to_devices,
            bonds=tuple(b for b in self.bonds if {b.bond.motion.participant, b.bond.force.participant} & own),
        )

    def hosts(self) -> tuple[str, ...]:
        """Return the names of all hosts, the hub's own first."""
        names = {planned.host for planned in self.participants.values()} - {"hub"}
        return ("hub", *sorted(names))


def has_simulated_time(ports: Sequence[Port]) -> bool:
    """Return whether a device with these ports lives in simulated time.

    True if there are outputs and all outputs are stamped with simulated time.
    """
    outputs = [port for port in ports if port.causality == "output"]
    return bool(outputs) and all(port.clock == "simulated" for port in outputs)
