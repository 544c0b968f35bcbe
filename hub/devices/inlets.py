"""Inlets: where device samples, and values set by hand, enter simulated time.

Samples arrive at any time and are checked at once; at a communication point the newest of each stream
and all of each event queue are written into the grant. Nothing else enters a simulation.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from hub.observation.latency import Latencies
from hub.planning.plan import Plan
from hub.transport.envelope import Stamp
from hub.transport.port_codec import PortCodec
from schemas.errors import LateError, MessageError, did_you_mean
from schemas.lockstep import Entering
from schemas.ports import Port

__all__ = ["Inlets"]

_MOST_QUEUED = 10_000
"""An event queue this long is a flood: more samples are refused until the next communication point."""


class _Queued(NamedTuple):
    """A sample received but not yet entered."""

    payload: bytes
    value: Any
    arrived_ns: int
    sent_ns: int | None
    """Time by the device's own clock."""


@dataclass
class _Inlet:
    source: str
    port: str
    codec: PortCodec
    number: int
    """Index among all inlets."""
    simulated: bool = False
    max_age_ns: int = 0
    queue: deque[_Queued] = field(default_factory=deque[_Queued])
    arrived_ns: int | None = None
    stale: bool = True
    newest: tuple[int, int] = (0, 0)
    """Admission and sequence number."""

    def __post_init__(self) -> None:
        """Note the stream's name in reports."""
        self.name = f"{self.source}.{self.port}"

    def follow(self, stamp: Stamp) -> None:
        """Raise LateError for a sample not newer than the last sample."""
        if stamp[:2] <= self.newest:
            raise LateError(
                f"sample {stamp.sequence} of '{self.source}.{self.port}' is late: {self.newest[1]} arrived"
                " before it"
            )
        self.newest = stamp[:2]


class Inlets:
    """An inlet for every connected device output, and for every input without a connection.

    `offer` may be called from any thread, `sample` by the step loop alone.
    """

    def __init__(self, plan: Plan) -> None:
        self._lock = threading.Lock()
        self.latencies = Latencies()
        """Latencies from a device to the grant."""
        self.offsets_ns = {
            planned.name: 0
            for planned in plan.participants.values()
            if planned.simulated_time or (planned.role == "device" and planned.host == "hub")
        }
        """Difference from a device's clock to the hub's, where known."""
        self._inlets: dict[tuple[str, str], _Inlet] = {}
        for inlet in plan.from_devices:
            port = plan.participants[inlet.target].port(inlet.target_port)
            source = plan.participants[inlet.source].port(inlet.source_port)
            device = plan.participants[inlet.source]
            new = _Inlet(
                inlet.source,
                inlet.source_port,
                PortCodec(source.filled_from(port)),
                len(self._inlets),
                simulated=device.simulated_time,
            )
            known = self._inlets.setdefault((inlet.source, inlet.source_port), new)
            known.max_age_ns = min((age for age in (known.max_age_ns, inlet.max_age_ns) if age), default=0)
        connected = {(c.target, c.target_port) for c in (*plan.connections, *plan.from_devices)}
        self._settable = {
            (planned.name, port.name): port
            for planned in plan.participants.values()
            for port in planned.ports
            if planned.in_step and port.causality == "input" and (planned.name, port.name) not in connected
        }
        for (name, port_name), port in self._settable.items():
            self._inlets[name, port_name] = _Inlet(
                name, port_name, PortCodec(port), len(self._inlets), stale=port.max_age_ns > 0
            )
        self._all = list(self._inlets.values())
        self._aging = {inlet.number for inlet in self._all if inlet.max_age_ns}
        self._offered: set[int] = set()
        """The inlets with samples not yet entered."""

    def settable(self, participant: str, port: str) -> Port:
        """Return the input for `set`; raises MessageError if the input is connected or does not exist."""
        found = self._settable.get((participant, port))
        if found is None:
            raise MessageError(
                f"'{participant}.{port}' cannot be"
                f" set.{did_you_mean(f'{participant}.{port}', ('.'.join(k) for k in self._settable))}"
            )
        return found

    def offer(
        self, participant: str, port: str, payload: bytes, now_ns: int, stamp: Stamp | None = None
    ) -> None:
        """Keep a sample that arrived at `now_ns` of the port's clock; a value set by hand has no stamp.

        Raises MessageError if the sample is invalid for this port, and LateError after a newer sample.
        """
        inlet = self._inlets.get((participant, port))
        if inlet is None:
            raise MessageError(f"no connection takes '{participant}.{port}'")
        value = inlet.codec.accept(payload)
        with self._lock:
            if stamp is not None:
                inlet.follow(stamp)
            if not inlet.codec.is_event:
                inlet.queue.clear()
            elif len(inlet.queue) >= _MOST_QUEUED:
                raise MessageError(
                    f"'{participant}.{port}' has {_MOST_QUEUED} samples waiting; this one is refused"
                )
            inlet.queue.append(_Queued(payload, value, now_ns, None if stamp is None else stamp.sent_ns))
            inlet.arrived_ns = now_ns
            self._offered.add(inlet.number)

    def restart(self, devices: Collection[str]) -> list[Entering]:
        """Forget all samples of `devices`; return the resulting entries: the devices' signals are stale.

        So an arm holds until the hand has sent a new pose, and pressed the button, anew.
        """
        entering: list[Entering] = []
        with self._lock:
            for inlet in self._all:
                if inlet.source in devices:
                    inlet.queue.clear()
                    inlet.arrived_ns, inlet.stale = None, True
                    self._offered.discard(inlet.number)
                    if not inlet.codec.is_event:
                        entering.append(_staleness_change(inlet, stale=True))
        return entering

    def sample(self, time_ns: int, wall_ns: int) -> list[Entering]:
        """Return the entries at a communication point: new samples, and changes of staleness.

        Samples of a device in simulated time age in `time_ns`, all other samples in `wall_ns`.
        """
        entering: list[Entering] = []
        with self._lock:
            for number in sorted(self._offered | self._aging):
                inlet = self._all[number]
                now_ns = time_ns if inlet.simulated else wall_ns
                stale = inlet.stale
                if inlet.arrived_ns is not None:
                    stale = bool(inlet.max_age_ns) and now_ns - inlet.arrived_ns > inlet.max_age_ns
                offset_ns = self.offsets_ns.get(inlet.source)
                for payload, value, arrived_ns, sent_ns in inlet.queue:
                    content, age_ns = np.frombuffer(payload, np.uint8), now_ns - arrived_ns
                    decoded = inlet.codec.layout, value
                    entering.append(Entering(inlet.source, inlet.port, stale, content, age_ns, decoded))
                    if sent_ns is not None and offset_ns is not None:
                        self.latencies.add("device to grant", inlet.name, now_ns - sent_ns - offset_ns)
                if stale != inlet.stale and not inlet.queue:
                    entering.append(_staleness_change(inlet, stale=stale))
                inlet.queue.clear()
                inlet.stale = stale
            self._offered.clear()
        return entering


def _staleness_change(inlet: _Inlet, *, stale: bool) -> Entering:
    return Entering(inlet.source, inlet.port, stale, np.zeros(0, np.uint8), 0)
