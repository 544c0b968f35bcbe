"""How the participants of one host are connected: by cells in this process, by a wire to others."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

from hub.hosting.hosted_participant import HostedParticipant, Output, hosted
from hub.participant import Stepped
from hub.planning.plan import Plan, PlannedParticipant
from hub.transport.bundle import Bundle, bundled
from hub.transport.cells import INITIAL, Cell, RemoteCell
from hub.transport.port_codec import PortCodec
from hub.transport.reader import DeviceInputs, Reader, as_messages
from hub.transport.wire import Wire
from schemas.ports import Port

__all__ = ["HostLayout", "OutputListener"]

OutputListener = Callable[[PlannedParticipant, Port, int, int, Any], None]
"""Is called with every output value: participant, port, step, time (ns) at which it is valid, value."""

_MANY = 32
"""Values of one port that may wait for their reader; the sender waits at some 160, a socket of Linux."""


class HostLayout:
    """The participants of host `name`, connected as `plan` says.

    The attributes are complete when it is made. `wire` carries values to and from other processes, `listener`
    is called with every output value.
    """

    def __init__(
        self,
        name: str,
        plan: Plan,
        participants: Mapping[str, Stepped],
        wire: Wire | None,
        listener: OutputListener | None,
    ) -> None:
        self._name, self._plan, self._wire, self._listener = name, plan, wire, listener
        self.participants = [
            hosted(plan.participants[p], participants[p], plan.step_ns)
            for p in plan.order
            if plan.participants[p].host == name
        ]
        """In step order."""
        self._by_name = {one.name: one for one in self.participants}
        self.remote_cells: dict[tuple[str, str], RemoteCell] = {}
        """The outputs of other hosts that are read here, by participant and port."""
        for one in self.participants:
            self._add_outputs(one)
        for one in self.participants:
            one.readers = self._readers(one.planned)
        readers = {
            planned.name: self._readers(planned)
            for planned in plan.participants.values()
            if planned.simulated_time and planned.host == name
        }
        self.device_inputs = {device: DeviceInputs(its, plan.step_ns) for device, its in readers.items()}
        """The inputs of the devices here that live in simulated time."""
        self.seldom_read = self._seldom_read({reader.cell for its in readers.values() for reader in its})
        """Cells that fill between two readings, with period (steps) and freshness of all their readers."""
        self.inlets = self._inlets()
        """Where a sample in a grant goes, by its source and port: participant, its port, and the codec."""

    def _add_outputs(self, one: HostedParticipant) -> None:
        planned, plan = one.planned, self._plan
        indices = self._bundle_indices(one, self._wire) if self._wire is not None else {}
        for port in planned.ports:
            if port.causality == "input":
                continue
            stride = plan.stride(planned.name, port.name)
            depth = self._depth(planned.name, port.name, here=True)
            hosts = self._reading_hosts(planned.name, port.name)
            to_devices = port.variability == "event" and any(
                (outlet.source, outlet.source_port) == (planned.name, port.name) for outlet in plan.to_devices
            )
            publisher = None
            if self._wire is not None:
                publisher = self._wire.publisher(
                    planned, port, hosts, feeds=to_devices, bundles=indices.get(port.name, ())
                )
            vector = PortCodec(port).vector
            output = Output(
                port,
                vector,
                () if vector is None else vector.neutral.shape,
                Cell(planned.period, stride, depth) if depth else None,
                publisher,
            )
            outputs = one.outputs.setdefault(stride, [])
            outputs.insert(0 if hosts else len(outputs), output)  # first what another host waits for

    def _reading_hosts(self, source: str, port: str) -> list[str]:
        """Return the other hosts that read an output."""
        hosts = {
            self._plan.participants[connection.target].host
            for connection in self._plan.connections
            if (connection.source, connection.source_port) == (source, port)
        }
        return sorted(hosts - {self._name})

    def _depth(self, source: str, port: str, *, here: bool | None = None) -> int:
        """Return how many values of an output readers look back.

        None in this process: 0; the newest only: 1; the last ones: more.
        """
        depth = 0
        for connection in self._plan.connections:
            target = self._plan.participants[connection.target]
            if (connection.source, connection.source_port) != (source, port):
                continue
            if here and target.host != self._name:
                continue
            is_event = target.port(connection.target_port).variability == "event"
            back = max(target.period // self._plan.stride(source, port), 1) if is_event else 0
            depth = max(depth, (1 if connection.fresh else 2) + connection.linear + back)
        return depth

    def _bundle_indices(self, one: HostedParticipant, wire: Wire) -> dict[str, list[tuple[Bundle, int]]]:
        """Make the bundles for devices; return for each output port its bundles and its index in them."""
        indices: dict[str, list[tuple[Bundle, int]]] = {}
        outlets = [outlet for outlet in self._plan.to_devices if outlet.source == one.name]
        for device in dict.fromkeys(outlet.target for outlet in outlets):
            bundle = one.bundles[device] = wire.bundle(one.name, device)
            for index, outlet in enumerate(bundled(self._plan, one.name, device)):
                indices.setdefault(outlet.source_port, []).append((bundle, index))
        return indices

    def _readers(self, reading: PlannedParticipant) -> list[Reader]:
        readers: list[Reader] = []
        for connection in self._plan.connections:
            if connection.target != reading.name:
                continue
            source_name, source_port = connection.source, connection.source_port
            source = self._plan.participants[source_name].port(source_port)
            target = reading.port(connection.target_port)
            readers.append(
                Reader(
                    target.name,
                    self._cell(source_name, source_port),
                    connection.fresh,
                    connection.linear,
                    as_messages(source, target),
                    self._plan.stride(source_name, source_port) * (self._plan.step_ns / 1e9),
                )
            )
        return readers

    def _cell(self, source: str, port: str) -> Cell:
        if source in self._by_name:
            outputs = self._by_name[source].outputs[self._plan.stride(source, port)]
            return next(o.cell for o in outputs if o.port.name == port and o.cell is not None)
        if (source, port) not in self.remote_cells:
            if self._wire is None:
                raise ValueError(f"'{source}' is in another process, and this host has no wire")
            planned = self._plan.participants[source]
            declared = planned.port(port)
            self.remote_cells[source, port] = self._wire.cell(
                planned,
                declared,
                self._plan.stride(source, port),
                self._depth(source, port),
                self._remote_listener(planned, declared),
            )
        return self.remote_cells[source, port]

    def _remote_listener(self, planned: PlannedParticipant, port: Port) -> Callable[[int, Any], None] | None:
        """Return what calls the listener with the values of another host."""
        listener, step_ns = self._listener, self._plan.step_ns
        if listener is None:
            return None
        return lambda tag, value: listener(
            planned, port, tag, (tag + planned.period) * step_ns if tag > INITIAL else 0, value
        )

    def _seldom_read(
        self, of_devices: Collection[Cell]
    ) -> Sequence[tuple[RemoteCell, list[tuple[int, bool]]]]:
        """Return the cells of which many values arrive between two readings.

        The devices here take their values more often: the cells that they read are left to them.
        """
        readers: dict[RemoteCell, list[tuple[int, bool]]] = {}
        for one in self.participants:
            for reader in one.readers:
                if isinstance(reader.cell, RemoteCell):
                    readers.setdefault(reader.cell, []).append((one.planned.period, reader.fresh))
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
            entries.append((one, port.name, PortCodec(port.filled_from(source))))
            if port.variability == "signal":
                one.stale.add(port.name)
        connected = {(c.target, c.target_port) for c in (*plan.connections, *plan.from_devices)}
        for one in self.participants:
            for port in one.planned.ports:
                if port.causality == "input" and (one.name, port.name) not in connected:
                    inlets[one.name, port.name] = [(one, port.name, PortCodec(port))]
                    if port.max_age_ns:  # no sample yet, as from a device that is silent
                        one.stale.add(port.name)
        return inlets
