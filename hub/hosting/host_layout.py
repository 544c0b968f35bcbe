"""Connections of the participants of a host: by cells in this process, by a wire to others."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import partial
from typing import Protocol

from hub.hosting.hosted_participant import HostedParticipant, host_participant
from hub.hosting.outputs import DueOutputs, Listener, Output, VectorsListener
from hub.participant import Stepped
from hub.planning.plan import Plan, PlannedConnection, PlannedParticipant
from hub.transport.bundle import Bundle, bundled_connections
from hub.transport.cells import Cell, RemoteCell
from hub.transport.port_codec import PortCodec, codec_of
from hub.transport.reader import DeviceInputs, Queue, Reader, as_messages
from hub.transport.wire import Wire
from schemas.ports import Port

__all__ = ["HostLayout", "Listeners"]


class Listeners(Protocol):
    """Returns the listeners for every value of some outputs; None without a listener."""

    def listener(self, planned: PlannedParticipant, codec: PortCodec) -> Listener | None:
        """Return the listener of messages or events."""
        ...

    def vectors_listener(self, planned: PlannedParticipant, ports: Sequence[Port]) -> VectorsListener | None:
        """Return the listener of vectors due together."""
        ...

    def watches(self, participant: str, port: str) -> bool:
        """Return whether the values of an output are used."""
        ...


_MANY = 32
"""Most values of a port waiting for their reader; beyond 4096, a `ZenohReceiver` stops all others."""


class HostLayout:
    """The participants of host `name`, connected as `plan` says.

    The attributes are complete from the start. `wire` carries values to and from remote processes,
    `listeners` returns the listeners of outputs.
    """

    def __init__(
        self,
        name: str,
        plan: Plan,
        participants: Mapping[str, Stepped],
        wire: Wire | None,
        listeners: Listeners | None,
    ) -> None:
        self._name, self._plan, self._wire, self._listeners = name, plan, wire, listeners
        self.participants = [
            host_participant(plan.participants[p], participants[p], plan.step_ns)
            for p in (*plan.order, *(one.name for one in plan.observers()))
            if plan.participants[p].host == name
        ]
        """Hosted participants in step order, or observers alone."""
        self._by_name = {one.name: one for one in self.participants}
        self.remote_cells: dict[tuple[str, str], RemoteCell] = {}
        """The outputs of remote hosts read here, by participant and port."""
        self._outputs: dict[tuple[str, str], Output] = {}
        by_stride = {one.name: self._add_outputs(one) for one in self.participants}
        for one in self.participants:
            one.readers = self._readers(one)
        for one in self.participants:
            listener = partial(self._vectors_listener, one.planned)
            one.outputs = [
                (stride, DueOutputs(its, wire, listener)) for stride, its in by_stride[one.name].items()
            ]
        readers = {
            planned.name: [self._reader(connection) for connection in self._feeding(planned.name)]
            for planned in plan.participants.values()
            if planned.simulated_time and planned.host == name
        }
        self.device_inputs = {device: DeviceInputs(its, plan.step_ns) for device, its in readers.items()}
        """The inputs of the devices in simulated time here."""
        self.seldom_read = self._seldom_read({reader.cell for its in readers.values() for reader in its})
        """Cells filling up between two readings, with period (steps) and freshness of all their readers."""
        self.inlets = self._inlets()
        """Targets of samples in a grant, by source and port: participant, input port, and codec."""

    def _add_outputs(self, one: HostedParticipant) -> dict[int, list[Output]]:
        """Make the outputs of `one`; return the outputs by stride."""
        planned, plan = one.planned, self._plan
        by_stride: dict[int, list[Output]] = {}
        indices = self._bundle_indices(one, self._wire) if self._wire is not None else {}
        for port in planned.ports:
            if port.causality == "input":
                continue
            codec, listeners = PortCodec(port), self._listeners
            stride = plan.output_stride(planned.name, port.name)
            depth = self._depth(planned.name, port.name, here=True)
            readers = self._reading_hosts(planned.name, port.name)
            to_devices = port.variability == "event" and any(
                (outlet.source, outlet.source_port) == (planned.name, port.name) for outlet in plan.to_devices
            )
            publisher = None
            if self._wire is not None:
                publisher = self._wire.publisher(
                    planned,
                    codec,
                    readers,
                    feeds=to_devices,
                    bundles=indices.get(port.name, ()),
                    stride_ns=stride * plan.step_ns,
                )
            output = self._outputs[planned.name, port.name] = Output(
                port,
                codec.vector,
                stride > planned.period,
                Cell(planned.period, stride, depth) if depth else None,
                publisher,
                listeners.listener(planned, codec)
                if listeners is not None and codec.vector is None
                else None,
            )
            output.watched = listeners is not None and listeners.watches(planned.name, port.name)
            one.ports.append(output)
            # an observer misses steps: of each that it takes, all is published
            outputs = by_stride.setdefault(1 if planned.observer else stride, [])
            outputs.insert(0 if readers else len(outputs), output)  # first what another host waits for
        return by_stride

    def _reading_hosts(self, source: str, port: str) -> list[str]:
        """Return the other hosts that read an output."""
        hosts = [
            self._plan.participants[connection.target].host
            for connection in self._plan.connections
            if (connection.source, connection.source_port) == (source, port)
        ]
        return [host for host in dict.fromkeys(hosts) if host != self._name]

    def _depth(self, source: str, port: str, *, here: bool | None = None) -> int:
        """Return how many values of an output readers look back.

        No reader in this process: 0; the newest value only: 1; the last values: more.
        """
        depth = 0
        for connection in self._plan.connections:
            target = self._plan.participants[connection.target]
            if (connection.source, connection.source_port) != (source, port):
                continue
            if here and (target.host != self._name or self._is_direct(connection)):
                continue
            is_event = target.port(connection.target_port).variability == "event"
            back = max(target.period // self._plan.output_stride(source, port), 1) if is_event else 0
            depth = max(depth, (1 if connection.fresh else 2) + connection.linear + back)
        return depth

    def _bundle_indices(self, one: HostedParticipant, wire: Wire) -> dict[str, list[tuple[Bundle, int]]]:
        """Make the bundles; return for each output port the bundles of the port, and the index in each."""
        indices: dict[str, list[tuple[Bundle, int]]] = {}
        outlets = [outlet for outlet in self._plan.to_devices if outlet.source == one.name]
        for name in dict.fromkeys(outlet.target for outlet in outlets):
            signals, target = bundled_connections(self._plan, one.name, name), self._plan.participants[name]
            bundle = one.bundles[name] = wire.bundle(one.name, target, self._plan.step_ns, len(signals))
            for index, outlet in enumerate(signals):
                indices.setdefault(outlet.source_port, []).append((bundle, index))
        return indices

    def _feeding(self, target: str) -> list[PlannedConnection]:
        return [connection for connection in self._plan.connections if connection.target == target]

    def _ports(self, connection: PlannedConnection) -> tuple[Port, Port]:
        participants = self._plan.participants
        source = participants[connection.source].port(connection.source_port)
        return source, participants[connection.target].port(connection.target_port)

    def _is_direct(self, connection: PlannedConnection) -> bool:
        """Return whether the target is to see the source's last outputs in every step.

        Both are here; the source of a fresh value steps before the reader, the source of an older value
        after.
        """
        source, target = (self._by_name.get(name) for name in (connection.source, connection.target))
        if source is None or target is None or source is target or connection.linear:
            return False
        output, into = self._ports(connection)
        if into.variability == "event" and output.variability == "signal":
            return False
        is_first = self._plan.order.index(source.name) < self._plan.order.index(target.name)
        if connection.fresh:
            return is_first
        return not is_first and target.period % source.period == 0

    def _readers(self, one: HostedParticipant) -> list[Queue | Reader]:
        """Let neighbours write to the inputs of `one` where possible; return readers for the rest."""
        readers: list[Queue | Reader] = []
        for connection in self._feeding(one.name):
            port = connection.target_port
            if not self._is_direct(connection):
                readers.append(self._reader(connection))
                continue
            output = self._outputs[connection.source, connection.source_port]
            if output.port.variability == "event":
                readers.append(queue := Queue(port))
                output.queues.append(queue)
            else:
                output.inputs.append((one.values, port))
        return readers

    def _reader(self, connection: PlannedConnection) -> Reader:
        source, target = self._ports(connection)
        stride = self._plan.output_stride(connection.source, source.name)
        return Reader(
            target.name,
            self._cell(connection.source, source.name),
            connection.fresh,
            connection.linear,
            as_messages(source, target),
            stride * (self._plan.step_ns / 1e9),
        )

    def _cell(self, source: str, port: str) -> Cell:
        output = self._outputs.get((source, port))
        if output is not None and output.cell is not None:
            return output.cell
        if (source, port) not in self.remote_cells:
            if self._wire is None:
                raise ValueError(f"'{source}' is in another process, and this host has no wire")
            planned = self._plan.participants[source]
            self.remote_cells[source, port] = self._wire.cell(
                planned, planned.port(port), self._plan.output_stride(source, port), self._depth(source, port)
            )
        return self.remote_cells[source, port]

    def _vectors_listener(self, planned: PlannedParticipant, ports: Sequence[Port]) -> VectorsListener | None:
        return None if self._listeners is None else self._listeners.vectors_listener(planned, ports)

    def _seldom_read(
        self, of_devices: Collection[Cell]
    ) -> Sequence[tuple[RemoteCell, list[tuple[int, bool]]]]:
        """Return the cells with many values arriving between two readings.

        The devices here take their values more often: cells read by devices are left out.
        """
        readers: dict[RemoteCell, list[tuple[int, bool]]] = {}
        for one in self.participants:
            for reader in one.readers:
                if isinstance(reader, Reader) and isinstance(reader.cell, RemoteCell):
                    readers.setdefault(reader.cell, []).append((one.period, reader.fresh))
        return [
            (cell, its)
            for cell, its in readers.items()
            if cell not in of_devices and min(period for period, _ in its) > _MANY * cell.stride
        ]

    def _inlets(self) -> dict[tuple[str, str], list[tuple[HostedParticipant, str, PortCodec]]]:
        inlets: dict[tuple[str, str], list[tuple[HostedParticipant, str, PortCodec]]] = {}
        plan = self._plan
        for inlet in plan.from_devices:
            one = self._by_name.get(inlet.target)
            if one is None:
                continue
            port = one.planned.port(inlet.target_port)
            source = plan.participants[inlet.source].port(inlet.source_port)
            entries = inlets.setdefault((inlet.source, inlet.source_port), [])
            entries.append((one, port.name, codec_of(port.filled_from(source))))
            # the grants of a session that was forked may hold a value by the input that it enters
            inlets[one.name, port.name] = [(one, port.name, codec_of(port.filled_from(source)))]
            if port.variability == "signal":
                one.stale.add(port.name)
        every = (*plan.connections, *plan.from_devices, *plan.to_devices)
        connected = {(c.target, c.target_port) for c in every}
        for one in self.participants:
            for port in one.planned.ports:
                if port.causality == "input" and (one.name, port.name) not in connected:
                    inlets[one.name, port.name] = [(one, port.name, codec_of(port))]
                    if port.max_age_ns:  # no sample yet, as from a device that is silent
                        one.stale.add(port.name)
        return inlets
