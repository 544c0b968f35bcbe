"""One process' share of a session: steps its participants in order, hands their values on, and books what
they did.

The host does not know whether a value comes from a neighbour in this process or from another one: both are
cells.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path
from time import perf_counter_ns
from typing import Any

import numpy as np

from hub.participant import Inputs, Outputs, Setup, Stepped
from hub.planning.plan import Plan, PlannedParticipant
from hub.transport.bundle import Bundle, bundled
from hub.transport.cells import INITIAL, Cell, RemoteCell
from hub.transport.envelope import Tag
from hub.transport.port_codec import PortCodec
from hub.transport.port_publisher import PortPublisher
from hub.transport.reader import DeviceInputs, Reader, as_messages
from hub.transport.wire import Wire
from schemas.errors import MessageError, ParticipantError, TrocarError
from schemas.lockstep import Ack, Grant
from schemas.ports import BondSide, Port
from schemas.vectors import VectorCodec

__all__ = ["Done", "Host", "Tap"]

log = logging.getLogger(__name__)

Tap = Callable[[PlannedParticipant, Port, int, int, Any], None]
"""Is shown every output value: participant, port, step, time (ns) at which it is valid, value."""

Done = Callable[[PlannedParticipant, Ack], None]
"""Gets the report of a participant that has done its part of a grant."""


@dataclass(slots=True)
class _Sink:
    """An output port and everywhere its value goes."""

    port: Port
    vector: VectorCodec | None
    shape: tuple[int, ...]
    cell: Cell | None
    publisher: PortPublisher | None


@dataclass(slots=True)
class _Slot:
    """A participant and all that its steps need, laid out for the step loop."""

    participant: Stepped
    planned: PlannedParticipant
    h_ns: int
    inputs: Inputs
    values: dict[str, Any]
    rates: dict[str, Any]
    events: dict[str, tuple[Any, ...]]
    stale: set[str]
    readers: list[Reader] = field(default_factory=list[Reader])
    sinks: dict[int, list[_Sink]] = field(default_factory=dict[int, list[_Sink]])
    """By stride, so that a step looks only at those that are due."""
    bundles: dict[str, Bundle] = field(default_factory=dict[str, Bundle])
    """By the device that they are for."""
    work_ports: tuple[str, ...] = ()
    hashes: list[int] = field(default_factory=list[int])
    compute_ns: list[int] = field(default_factory=list[int])
    work_j: list[float] = field(default_factory=list[float])


_MANY = 32
"""Values of one port that may wait for their reader: a socket of Linux holds some 160, and then the sender
stands.
"""


class Host:
    """The stepped participants of one process."""

    def __init__(
        self,
        name: str,
        plan: Plan,
        participants: Mapping[str, Stepped],
        *,
        wire: Wire | None = None,
        tap: Tap | None = None,
    ) -> None:
        """Lay out the participants of host `name`; `wire` carries values to and from other processes, `tap`
        sees every output.
        """
        self.name = name
        self.plan = plan
        self._step_s = plan.step_ns / 1e9
        self._wire = wire
        self._tap = tap
        self._slots = [
            self._slot(plan.participants[p], participants[p])
            for p in plan.order
            if plan.participants[p].host == name
        ]
        self._by_name = {slot.planned.name: slot for slot in self._slots}
        self._remote: dict[tuple[str, str], RemoteCell] = {}
        self.step = INITIAL
        """The step in which it is or was last."""
        self._stepping: str | None = None
        self._inlets: dict[tuple[str, str], list[tuple[_Slot, str, PortCodec]]] = {}
        self._initial: list[tuple[PortPublisher, Any]] = []
        for slot in self._slots:
            self._lay_sinks(slot)
        for slot in self._slots:
            slot.readers = self._readers(slot.planned)
        fed = {
            m.name: self._readers(m)
            for m in plan.participants.values()
            if m.simulated_time and m.host == name
        }
        self.feeds = {device: DeviceInputs(readers, plan.step_ns) for device, readers in fed.items()}
        """What the devices here that follow the clock are to be written."""
        self._seldom_read = self._lay_seldom_read(
            {reader.cell for readers in fed.values() for reader in readers}
        )
        self._lay_inlets()

    # --- laying out
    # ------------------------------------------------------------------------------------------------

    def _slot(self, planned: PlannedParticipant, participant: Stepped) -> _Slot:
        values = {
            port.name: _start_value(port)
            for port in planned.ports
            if port.causality == "input" and port.variability == "signal"
        }
        inputs = Inputs(values)
        rates, events, stale = (
            inputs._rates,
            inputs._events,
            inputs._stale,
        )  # pyright: ignore[reportPrivateUsage]  # the host fills them
        slot = _Slot(
            participant, planned, planned.period * self.plan.step_ns, inputs, values, rates, events, stale
        )
        slot.work_ports = tuple(f"{bond.name}/work" for bond in planned.bonds)
        return slot

    def _depth(self, source: str, port: str, *, here: bool | None = None) -> int:
        """Return how many values of an output readers look back: none in this process, one for the newest
        only, more for the last ones.
        """
        depth = 0
        for link in self.plan.connections:
            target = self.plan.participants[link.target]
            if (link.source, link.source_port) != (source, port) or (here and target.host != self.name):
                continue
            back = max(target.period // self.plan.stride(source, port), 1)
            depth = max(
                depth,
                (1 if link.fresh else 2)
                + link.linear
                + (back if target.port(link.target_port).variability == "event" else 0),
            )
        return depth

    def _lay_sinks(self, slot: _Slot) -> None:
        planned, wire = slot.planned, self._wire
        places = self._places(slot, wire) if wire is not None else {}
        for port in planned.ports:
            if port.causality == "input":
                continue
            stride = self.plan.stride(planned.name, port.name)
            depth = self._depth(planned.name, port.name, here=True)
            readers = sorted(
                {
                    self.plan.participants[k.target].host
                    for k in self.plan.connections
                    if (k.source, k.source_port) == (planned.name, port.name)
                }
                - {self.name}
            )
            feeds = port.variability == "event" and (planned.name, port.name) in {
                (outlet.source, outlet.source_port) for outlet in self.plan.to_devices
            }
            publisher = (
                wire.publisher(planned, port, readers, feeds=feeds, bundles=places.get(port.name, ()))
                if wire is not None
                else None
            )
            cell = Cell(planned.period, stride, depth) if depth else None
            vector = PortCodec(port).vector
            sink = _Sink(port, vector, () if vector is None else vector.neutral.shape, cell, publisher)
            sinks = slot.sinks.setdefault(stride, [])
            sinks.insert(0 if readers else len(sinks), sink)  # first what another host waits for

    def _places(self, slot: _Slot, wire: Wire) -> dict[str, list[tuple[Bundle, int]]]:
        """Lay out the bundles for devices; return by output port in which of them its value goes along, and
        as which.
        """
        places: dict[str, list[tuple[Bundle, int]]] = {}
        for device in dict.fromkeys(
            outlet.target for outlet in self.plan.to_devices if outlet.source == slot.planned.name
        ):
            bundle = slot.bundles[device] = wire.bundle(slot.planned.name, device)
            for index, outlet in enumerate(bundled(self.plan, slot.planned.name, device)):
                places.setdefault(outlet.source_port, []).append((bundle, index))
        return places

    def _readers(self, reading: PlannedParticipant) -> list[Reader]:
        readers: list[Reader] = []
        for link in self.plan.connections:
            if link.target != reading.name:
                continue
            source, target = (
                self.plan.participants[link.source].port(link.source_port),
                reading.port(link.target_port),
            )
            stride_s = self.plan.stride(link.source, link.source_port) * self._step_s
            cell = self._cell(link.source, link.source_port)
            readers.append(
                Reader(target.name, cell, link.fresh, link.linear, as_messages(source, target), stride_s)
            )
        return readers

    def _lay_seldom_read(self, fed: Collection[Cell]) -> list[tuple[RemoteCell, list[tuple[int, bool]]]]:
        """Return the cells of other hosts' values of which many arrive between two readings, with period
        (steps) and freshness of all that read them.

        Those from which devices are `fed` are left to them.
        """
        read: dict[RemoteCell, list[tuple[int, bool]]] = {}
        for slot in self._slots:
            for reader in slot.readers:
                if isinstance(reader.cell, RemoteCell):
                    read.setdefault(reader.cell, []).append((slot.planned.period, reader.fresh))
        return [
            (cell, by)
            for cell, by in read.items()
            if cell not in fed and min(period for period, _ in by) > _MANY * cell.stride
        ]

    def _cell(self, source: str, port: str) -> Cell:
        if source in self._by_name:
            sinks = self._by_name[source].sinks[self.plan.stride(source, port)]
            return next(sink.cell for sink in sinks if sink.port.name == port and sink.cell is not None)
        if (source, port) not in self._remote:
            if self._wire is None:
                raise ValueError(f"'{source}' is in another process, and this host has no wire")
            planned = self.plan.participants[source]
            declared = planned.port(port)
            self._remote[source, port] = self._wire.cell(
                planned,
                declared,
                self.plan.stride(source, port),
                self._depth(source, port),
                self._listener(planned, declared),
            )
        return self._remote[source, port]

    def _listener(self, planned: PlannedParticipant, port: Port) -> Callable[[int, Any], None] | None:
        """Return what shows values of another host to the tap of this one."""
        tap, step_ns = self._tap, self.plan.step_ns
        if tap is None:
            return None
        return lambda tag, value: tap(
            planned, port, tag, (tag + planned.period) * step_ns if tag > INITIAL else 0, value
        )

    def _lay_inlets(self) -> None:
        for inlet in self.plan.from_devices:
            if inlet.target in self._by_name:
                slot, port = (
                    self._by_name[inlet.target],
                    self.plan.participants[inlet.target].port(inlet.target_port),
                )
                codec = PortCodec(
                    port.filled_from(self.plan.participants[inlet.source].port(inlet.source_port))
                )
                self._inlets.setdefault((inlet.source, inlet.source_port), []).append(
                    (slot, port.name, codec)
                )
                if port.variability == "signal":
                    slot.stale.add(port.name)
        fed = {(link.target, link.target_port) for link in self.plan.connections} | {
            (i.target, i.target_port) for i in self.plan.from_devices
        }
        for slot in self._slots:
            for port in slot.planned.ports:
                if port.causality == "input" and (slot.planned.name, port.name) not in fed:
                    self._inlets[slot.planned.name, port.name] = [(slot, port.name, PortCodec(port))]

    # --- running
    # ---------------------------------------------------------------------------------------------------

    @property
    def participants(self) -> Sequence[PlannedParticipant]:
        """The participants of this host, in step order."""
        return [slot.planned for slot in self._slots]

    def configure(self, directory: Path) -> dict[str, tuple[BondSide, ...]]:
        """Configure every participant and publish its outputs at time 0; returns the bonds with the numbers
        now known.

        Raises ParticipantError naming the one that failed.
        """
        bonds: dict[str, tuple[BondSide, ...]] = {}
        for slot in self._slots:
            setup = Setup(period_ns=slot.h_ns, directory=directory, bonds=slot.planned.bond_plans)
            try:
                self._hand_on(slot, INITIAL, 0, slot.participant.configure(setup))
            except ParticipantError:
                raise
            except TrocarError as error:
                raise ParticipantError(slot.planned.name, INITIAL, str(error)) from error
            except Exception as error:
                log.exception("participant '%s' raised while it was configured", slot.planned.name)
                raise ParticipantError(
                    slot.planned.name, INITIAL, f"{type(error).__name__}: {error}"
                ) from error
            bonds[slot.planned.name] = slot.participant.bonds
        return bonds

    def publish_initial(self) -> None:
        """Publish the outputs at time 0 once more, for hosts that were not yet listening."""
        for publisher, value in self._initial:
            publisher.put(INITIAL, 0, value)
        for slot in self._slots:
            self._send_bundles(slot, INITIAL, 0)

    def drain(self) -> None:
        """Show the tap what has arrived from other hosts and nobody has asked for: at the end of a run."""
        if self._wire is not None:
            self._wire.drain()

    def linked(self) -> bool:
        """Say whether the values at time 0 of all other hosts that this one needs are here."""
        return self._wire is None or self._wire.linked()

    @property
    def awaited(self) -> str | None:
        """Who keeps `run` from going on: the participant in its step, or the one elsewhere whose value it
        waits for.
        """
        return next((source for (source, _), cell in self._remote.items() if cell.waiting), self._stepping)

    def due(self, step: int, count: int) -> list[str]:
        """Return who steps at least once in `count` steps from `step`, in step order."""
        return [s.planned.name for s in self._slots if -step % s.planned.period < count]

    def run(self, grant: Grant, done: Done) -> None:
        """Take what enters with `grant` and step to its horizon; `done` gets the report of each participant
        as soon as it is through.

        Raises ParticipantError.
        """
        for sample in grant.inlets:
            for slot, port, codec in self._inlets.get((sample.participant, sample.port), ()):
                self._enter(slot, port, codec, sample.payload.tobytes(), stale=sample.stale)
        step_ns = self.plan.step_ns
        end = grant.horizon_ns // step_ns
        for slot in self._slots:
            slot.hashes, slot.compute_ns, slot.work_j = [], [], []
        for step in range(grant.step, end):
            self.step = step
            for slot in self._slots:
                period = slot.planned.period
                if not step % period:
                    self._step(slot, step, step * step_ns)
                    if step + period >= end:
                        done(
                            slot.planned,
                            Ack(
                                grant.run, grant.epoch, grant.step, slot.hashes, slot.compute_ns, slot.work_j
                            ),
                        )
        self._stepping = None
        for cell, readers in self._seldom_read:
            cell.take_until(
                min(cell.tag(-(-end // period) * period, fresh=fresh) for period, fresh in readers)
            )

    def _step(self, slot: _Slot, step: int, t: int) -> None:
        self._stepping = slot.planned.name
        for reader in slot.readers:
            self._read(slot, reader, step)
        begun = perf_counter_ns()
        try:
            outputs = slot.participant.step(t, slot.h_ns, slot.inputs)
            slot.compute_ns.append(perf_counter_ns() - begun)
            self._hand_on(slot, step, t + slot.h_ns, outputs)  # before the hash: somebody may wait for it
            slot.hashes.append(slot.participant.state_hash())
            for port in slot.work_ports:
                work = float(outputs[port][0])  # pyright: ignore[reportArgumentType, reportIndexIssue]
                if not isfinite(work):
                    raise ParticipantError(slot.planned.name, step, f"output '{port}' is not finite: {work}")
                slot.work_j.append(work)
        except ParticipantError:
            raise
        except TrocarError as error:
            raise ParticipantError(slot.planned.name, step, str(error)) from error
        except Exception as error:
            log.exception("participant '%s' raised in step %d", slot.planned.name, step)
            raise ParticipantError(slot.planned.name, step, f"{type(error).__name__}: {error}") from error
        if slot.events:
            slot.events.clear()

    def _read(self, slot: _Slot, reader: Reader, step: int) -> None:
        cell = reader.cell
        if reader.messages is not None:
            if arrived := reader.events(step, self.plan.step_ns):
                slot.events[reader.port] = (
                    *slot.events.get(reader.port, ()),
                    *(message for _, message in arrived),
                )
            return
        tag = cell.tag(step, fresh=reader.fresh)
        value = cell.get(tag)
        if reader.linear:
            rate = slot.rates[reader.port] = (value - cell.get(cell.before(tag))) / reader.stride_s
            value = value + rate * ((step - cell.valid_from(tag)) * self._step_s)
        slot.values[reader.port] = value

    def _hand_on(self, slot: _Slot, step: int, time_ns: int, outputs: Outputs) -> None:
        for stride, sinks in slot.sinks.items():
            if step > INITIAL and (step + slot.planned.period) % stride:
                continue
            for sink in sinks:
                name = sink.port.name
                if name not in outputs:
                    raise ParticipantError(
                        slot.planned.name, step, f"output '{name}' is missing from what step() returned"
                    )
                value: Any = outputs[name]
                if sink.vector is not None and (
                    value.shape != sink.shape or not isfinite(value.dot(value)) or step == INITIAL
                ):
                    sink.vector.checked(value)  # raises what is wrong, unless the numbers are only large
                if sink.cell is not None:
                    sink.cell.put(step, value)
                if sink.publisher is not None:
                    sink.publisher.put(step, time_ns, value)
                    if step == INITIAL:
                        self._initial.append((sink.publisher, value if sink.vector is None else value.copy()))
                if self._tap is not None:
                    self._tap(slot.planned, sink.port, step, time_ns, value)
        if slot.bundles:
            self._send_bundles(slot, step, time_ns)

    def _send_bundles(self, slot: _Slot, step: int, time_ns: int) -> None:
        if self._wire is not None:
            for bundle in slot.bundles.values():
                bundle.send(Tag.pack(self._wire.run, 0, step, time_ns))

    def _enter(self, slot: _Slot, port: str, codec: PortCodec, payload: bytes, *, stale: bool) -> None:
        if stale:
            slot.stale.add(port)
        else:
            slot.stale.discard(port)
        if not payload:
            return
        try:
            value = codec.accept(payload)
        except MessageError as error:
            log.warning("inlet sample for '%s.%s' refused: %s", slot.planned.name, port, error)
            return
        if codec.is_event:
            slot.events[port] = (*slot.events.get(port, ()), value)
        else:
            slot.values[port] = value

    def close(self) -> None:
        """Close every participant, the last first; an error in one does not keep the others open."""
        for slot in reversed(self._slots):
            try:
                slot.participant.close()
            except Exception:
                log.exception("participant '%s' raised while it was closed", slot.planned.name)
        if self._wire is not None:
            self._wire.close()


def _start_value(port: Port) -> Any:
    codec = PortCodec(port)
    if codec.vector is None:
        return None
    return codec.vector.neutral.copy() if port.start is None else np.array(port.start, np.float64)
