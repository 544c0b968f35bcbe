"""The plan of a session: who runs where, and every connection and bond resolved into what hosts carry out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from pydantic import BaseModel, ConfigDict

from hub.participant import BondPlan
from schemas.network_link import LinkSpec
from schemas.ports import BondSide, Port
from schemas.scenario import Bond

__all__ = ["Inlet", "Link", "Member", "Plan", "PlannedBond", "plays_in_simulated_time"]


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Member(_Part):
    """One participant: where it runs, how often it steps, what goes in and out (the ports of its connected
    bonds included).
    """

    name: str
    kind: str
    role: Literal["engine", "controller", "device"]
    host: str
    """`hub`, the name of a process, or `remote/<participant>`."""
    period: int
    """In steps; a device that lives in wall time has 1."""
    read_ns: int = 0
    """Of a device that lives in wall time: the time between two reads."""
    link: LinkSpec | None = None
    """Of a device: what lies between it and the hub."""
    rate_limit: float = 2000.0
    """Of a device: messages per second that are taken from each of its ports."""
    ports: tuple[Port, ...]
    bonds: tuple[BondSide, ...] = ()
    bond_plans: dict[str, BondPlan] = {}

    def port(self, name: str) -> Port:
        """Return the port called `name`."""
        return next(port for port in self.ports if port.name == name)

    @property
    def follows_clock(self) -> bool:
        """Whether this is a device that plays in simulated time."""
        return self.role == "device" and plays_in_simulated_time(self.ports)

    @property
    def key_role(self) -> str:
        """The role as it stands in keys: all that is stepped is an engine there."""
        return "device" if self.role == "device" else "engine"


class Link(_Part):
    """A connection from a stepped participant to another one, or to a device that follows the clock."""

    source: str
    source_port: str
    target: str
    target_port: str
    fresh: bool
    """The target sees the source's output of the same step; otherwise that of the last communication point.
    """
    linear: bool
    """The target extrapolates inside its step."""


class Inlet(_Part):
    """A connection from a device to a stepped participant."""

    device: str
    device_port: str
    target: str
    target_port: str
    max_age_ns: int


class Outlet(_Part):
    """A connection from a stepped participant to a device that lives in wall time."""

    source: str
    source_port: str
    device: str
    device_port: str


class PlannedBond(_Part):
    """A bond and its two declared sides."""

    bond: Bond
    motion: BondSide
    force: BondSide


class Plan(_Part):
    """All that hosts need to know of a session."""

    step_ns: int
    order: tuple[str, ...]
    """The stepped participants in the order in which they step."""
    members: dict[str, Member]
    links: tuple[Link, ...]
    inlets: tuple[Inlet, ...]
    outlets: tuple[Outlet, ...]
    bonds: tuple[PlannedBond, ...]

    def stride(self, participant: str, port: str) -> int:
        """Return how many steps lie between two values of an output port."""
        member = self.members[participant]
        return max(member.period, member.port(port).period_ns // self.step_ns)

    def meetings(self) -> tuple[Member, ...]:
        """Return the devices that must be met at each of their periods: that follow the clock, and are
        written to or sit behind a link.
        """
        written = {link.target for link in self.links}
        return tuple(
            m for m in self.members.values() if m.follows_clock and (m.name in written or m.link is not None)
        )

    def seen_from(self, host: str) -> Plan:
        """Return what another machine needs to know that runs host `host`: its participants, and of the
        others the ports they share a connection with.
        """
        own = {name for name, member in self.members.items() if member.host == host}
        links = tuple(k for k in self.links if {k.source, k.target} & own)
        inlets = tuple(k for k in self.inlets if {k.device, k.target} & own)
        outlets = tuple(k for k in self.outlets if {k.source, k.device} & own)
        ends = {(k.source, k.source_port) for k in (*links, *outlets)} | {
            (k.target, k.target_port) for k in (*links, *inlets)
        }
        ends |= {(k.device, k.device_port) for k in (*inlets, *outlets)}
        shared: dict[str, Member] = {}
        for name, member in self.members.items():
            ports = tuple(port for port in member.ports if (name, port.name) in ends)
            if name in own:
                shared[name] = member
            elif ports:
                shared[name] = member.model_copy(update={"ports": ports, "bonds": (), "bond_plans": {}})
        bonds = tuple(b for b in self.bonds if {b.bond.motion.participant, b.bond.force.participant} & own)
        order = tuple(name for name in self.order if name in shared)
        return Plan(
            step_ns=self.step_ns,
            order=order,
            members=shared,
            links=links,
            inlets=inlets,
            outlets=outlets,
            bonds=bonds,
        )

    def hosts(self) -> tuple[str, ...]:
        """Return the names of all hosts, the hub's own first."""
        names = {member.host for member in self.members.values()} - {"hub"}
        return ("hub", *sorted(names))


def plays_in_simulated_time(ports: Sequence[Port]) -> bool:
    """Say whether a device with these ports follows the clock: it has outputs, and all are stamped with
    simulated time.
    """
    outputs = [port for port in ports if port.causality == "output"]
    return bool(outputs) and all(port.clock == "simulated" for port in outputs)
