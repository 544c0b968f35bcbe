"""A participant with all that its steps need, prepared once so that the step loop only looks things up."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hub.participant import Inputs, Stepped
from hub.planning.plan import PlannedParticipant
from hub.transport.bundle import Bundle
from hub.transport.cells import Cell
from hub.transport.port_codec import PortCodec
from hub.transport.port_publisher import PortPublisher
from hub.transport.reader import Reader
from schemas.message import Message
from schemas.ports import Port
from schemas.vectors import Vector, VectorCodec

__all__ = ["HostedParticipant", "Output", "hosted"]


@dataclass(slots=True)
class Output:
    """An output port and everywhere its value goes."""

    port: Port
    vector: VectorCodec | None
    shape: tuple[int, ...]
    cell: Cell | None
    """For readers in this process."""
    publisher: PortPublisher | None
    """For readers in other processes."""


@dataclass(slots=True)
class HostedParticipant:
    """A participant of this process, its inputs and outputs, and what it reports of a grant."""

    participant: Stepped
    planned: PlannedParticipant
    h_ns: int
    """Its step."""
    inputs: Inputs
    values: dict[str, Any]
    """What `inputs` reads, as are `rates`, `events` and `stale`."""
    rates: dict[str, Vector]
    events: dict[str, tuple[Message, ...]]
    stale: set[str]
    work_ports: tuple[str, ...]
    """The outputs that hold the work of its bonds."""
    readers: list[Reader] = field(default_factory=list[Reader])
    outputs: dict[int, list[Output]] = field(default_factory=dict[int, list[Output]])
    """By stride, so that a step looks only at those that are due."""
    bundles: dict[str, Bundle] = field(default_factory=dict[str, Bundle])
    """By the device that they are for."""
    hashes: list[int] = field(default_factory=list[int])
    """Of its steps in the present grant, as are `compute_ns` and `work_j`."""
    compute_ns: list[int] = field(default_factory=list[int])
    work_j: list[float] = field(default_factory=list[float])

    @property
    def name(self) -> str:
        """The participant's name."""
        return self.planned.name


def hosted(planned: PlannedParticipant, participant: Stepped, step_ns: int) -> HostedParticipant:
    """Return `participant` with its inputs at their start values; nothing is connected yet."""
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
        planned.period * step_ns,
        Inputs(values, rates=rates, events=events, stale=stale),
        values,
        rates,
        events,
        stale,
        work_ports=tuple(f"{bond.name}/work" for bond in planned.bonds),
    )


def _start_value(port: Port) -> Any:
    codec = PortCodec(port)
    if codec.vector is None:
        return None
    return codec.vector.neutral.copy() if port.start is None else np.array(port.start, np.float64)
