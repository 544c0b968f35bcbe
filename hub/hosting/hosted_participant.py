"""A participant with all data for the steps, prepared once: the step loop only looks data up."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hub.hosting.outputs import DueOutputs, Output
from hub.participant import Inputs, Outputs, Stepped
from hub.planning.plan import PlannedParticipant
from hub.transport.bundle import Bundle
from hub.transport.port_codec import codec_of
from hub.transport.reader import Queue, Reader
from schemas.message import Message
from schemas.ports import Port
from schemas.vectors import Vector

__all__ = ["HostedParticipant", "host_participant"]


@dataclass(slots=True)
class HostedParticipant:
    """A participant of this process, with inputs, outputs, and the report of a grant."""

    participant: Stepped
    planned: PlannedParticipant
    name: str
    period: int
    """Period of the participant, in communication steps."""
    h_ns: int
    """Step of the participant, ns."""
    inputs: Inputs
    values: dict[str, Any]
    """Values read by `inputs`, as are `rates`, `events` and `stale`."""
    rates: dict[str, Vector]
    events: dict[str, tuple[Message, ...]]
    stale: set[str]
    work_ports: tuple[str, ...]
    """The outputs with the work of the bonds."""
    readers: list[Queue | Reader] = field(default_factory=list[Queue | Reader])
    """Readers of the inputs not set by a neighbour, in the order of the connections."""
    outputs: list[tuple[int, DueOutputs]] = field(default_factory=list[tuple[int, DueOutputs]])
    """Outputs with their stride: a step looks only at the outputs due."""
    ports: list[Output] = field(default_factory=list[Output])
    """All outputs."""
    bundles: dict[str, Bundle] = field(default_factory=dict[str, Bundle])
    """Bundles by target, a device or observer."""
    newest: Outputs = field(default_factory=dict[str, Any])
    """Outputs returned last."""
    hashes: list[int] = field(default_factory=list[int])
    """State hashes of the steps in the present grant; `compute_ns` and `work_j` are of these steps too."""
    compute_ns: list[int] = field(default_factory=list[int])
    work_j: list[float] = field(default_factory=list[float])


def host_participant(planned: PlannedParticipant, participant: Stepped, step_ns: int) -> HostedParticipant:
    """Return `participant` with inputs at their start values; nothing is connected yet."""
    values = {
        port.name: _start_value(port)
        for port in planned.ports
        if port.causality == "input" and port.variability == "signal"
    }
    rates: dict[str, Vector] = {}
    events: dict[str, tuple[Message, ...]] = {}
    stale: set[str] = set()
    return HostedParticipant(
        participant,
        planned,
        planned.name,
        planned.period,
        planned.period * step_ns,
        Inputs(values, rates=rates, events=events, stale=stale),
        values,
        rates,
        events,
        stale,
        work_ports=tuple(f"{bond.name}/work" for bond in planned.bonds),
    )


def _start_value(port: Port) -> Any:
    codec = codec_of(port)
    if codec.vector is None:
        return None
    return codec.vector.neutral.copy() if port.start is None else np.array(port.start, np.float64)
