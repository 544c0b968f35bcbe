"""The plan of a participant: host, period and all ports."""

from __future__ import annotations

from collections.abc import Sequence

from hub.participant import BondPlan, Device, Stepped
from hub.planning.coupling import bond_plans
from hub.planning.plan import PlannedBond, PlannedParticipant, has_simulated_time
from hub.planning.registry import Role
from schemas.errors import ScenarioError
from schemas.ports import Port, bond_ports
from schemas.scenario import ParticipantSpec, Scenario

__all__ = ["plan_participant"]

_LEAST_READ_NS = 100_000
"""A Python loop with a shorter polling period keeps a core busy without getting more samples."""


def plan_participant(
    scenario: Scenario, participant: Stepped | Device, role: Role, bonds: Sequence[PlannedBond]
) -> PlannedParticipant:
    """Return the plan of a participant; `bonds` are the participant's bonds.

    Raises ScenarioError if the scenario does not fit the participant's declarations.
    """
    name = participant.name
    spec, path = scenario.participants[name], ("participants", name)
    sides = [
        side
        for one in bonds
        for end, side in ((one.bond.motion, one.motion), (one.bond.force, one.force))
        if end.participant == name
    ]
    ports = participant.ports + tuple(port for side in sides for port in bond_ports(side))
    is_device, simulated_time = isinstance(participant, Device), has_simulated_time(ports)
    if isinstance(participant, Device) and not simulated_time:
        period_ns, read_ns = scenario.step, _read_period_ns(participant, spec)
    else:
        period_ns, read_ns = _period_ns(scenario, spec, name, ports), 0
    if spec.network_link is not None and not is_device:
        raise ScenarioError(
            f"a network link is between a device and the hub, but '{name}' is no device ({role}): remove it",
            path=(*path, "network_link"),
        )
    if is_device and simulated_time and spec.host != "hub":
        raise ScenarioError(
            f"device '{name}' plays in simulated time, which only the hub's process has: remove its host",
            path=(*path, "host"),
        )
    return PlannedParticipant(
        name=name,
        kind=spec.kind,
        role=role,
        host=f"remote/{name}" if spec.host == "remote" else spec.host,
        period=period_ns // scenario.step,
        read_ns=read_ns,
        use_ns=participant.use_period_ns if isinstance(participant, Device) else 0,
        network_link=spec.network_link,
        rate_limit=spec.rate_limit,
        integration="" if isinstance(participant, Device) else participant.integration,
        ports=ports,
        bonds=tuple(sides),
        bond_plans=_bond_plans(name, bonds, period_ns),
    )


def _read_period_ns(device: Device, spec: ParticipantSpec) -> int:
    """Return how often a device in wall time is read."""
    period_ns = device.read_period_ns if spec.period is None else spec.period
    if period_ns < _LEAST_READ_NS:
        raise ScenarioError(
            f"period {period_ns / 1e6:g} ms: a device is read every {_LEAST_READ_NS / 1e6:g} ms at most",
            path=("participants", device.name, "period"),
        )
    return period_ns


def _period_ns(scenario: Scenario, spec: ParticipantSpec, name: str, ports: Sequence[Port]) -> int:
    """Return the period of a participant in simulated time."""
    period_ns = scenario.step if spec.period is None else spec.period
    if period_ns <= 0 or period_ns % scenario.step:
        raise ScenarioError(
            f"period {period_ns / 1e6:g} ms is no multiple of the step {scenario.step / 1e6:g} ms",
            path=("participants", name, "period"),
        )
    for port in ports:
        if port.period_ns % period_ns:
            raise ScenarioError(
                f"output '{port.name}' has a period of {port.period_ns / 1e6:g} ms, no multiple of the"
                f" participant's {period_ns / 1e6:g} ms",
                path=("participants", name),
            )
    return period_ns


def _bond_plans(name: str, bonds: Sequence[PlannedBond], period_ns: int) -> dict[str, BondPlan]:
    """Return the plans of a participant's sides, by the name of the side."""
    plans: dict[str, BondPlan] = {}
    for one in bonds:
        motion, force = bond_plans(one.bond, one.force, period_ns / 1e9)
        if one.bond.motion.participant == name:
            plans[one.motion.name] = motion
        if one.bond.force.participant == name:
            plans[one.force.name] = force
    return plans
