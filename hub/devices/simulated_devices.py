"""Devices in simulated time: read and written at communication points."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from hub.devices.network_link import NetworkLink
from hub.observation.latency import Latencies
from hub.participant import Device, Sample, Value
from hub.planning.plan import Plan, PlannedParticipant
from hub.transport.cells import INITIAL
from hub.transport.envelope import Stamp
from hub.transport.reader import DeviceInputs
from hub.transport.refusals import Refusals
from schemas.errors import ParticipantError

__all__ = ["SimulatedDevices", "close_device", "open_device"]

log = logging.getLogger(__name__)

Take = Callable[[str, Sample, int, Stamp], None]
"""Called with a sample: device, sample, time of arrival (simulated ns), and stamp."""


class SimulatedDevices:
    """The devices of the hub's process in simulated time.

    A device with inputs, or behind a network link, is exchanged with once in each of its own periods,
    wherever the connected participants run: the device is written the values computed by then, and read
    afterwards. All other devices are read at every communication point.
    """

    def __init__(
        self,
        plan: Plan,
        devices: Mapping[str, Device],
        inputs: Mapping[str, DeviceInputs],
        refusals: Refusals,
    ) -> None:
        periodic = {planned.name for planned in plan.exchanging_devices()}
        self._devices = [
            _SimulatedDevice(plan.participants[name], device, inputs[name], name in periodic, refusals)
            for name, device in devices.items()
        ]
        self.links = {device.name: device.link for device in self._devices}
        self.latencies = Latencies()
        """Latencies from a value to the device."""

    def open(self, directory: Path) -> None:
        """Open all; raises ParticipantError with the name of a device that cannot be opened."""
        for one in self._devices:
            open_device(one.name, one.device, directory)

    def exchange(self, time_ns: int, step: int, take: Take) -> None:
        """Write and read all devices due; raises ParticipantError."""
        for one in self._devices:
            if one.periodic and step % one.planned.period:
                continue
            try:
                one.write(time_ns, step, self.latencies)
                for sample, arrival_ns, stamp in one.read(time_ns):
                    take(one.name, sample, arrival_ns, stamp)
            except Exception as error:
                raise ParticipantError(one.name, step, f"{type(error).__name__}: {error}") from error

    def close(self) -> None:
        """Close all."""
        for one in self._devices:
            close_device(one.name, one.device)


class _SimulatedDevice:
    """A device, the network link, and the sequence numbers of the samples."""

    def __init__(
        self,
        planned: PlannedParticipant,
        device: Device,
        inputs: DeviceInputs,
        periodic: bool,
        refusals: Refusals,
    ) -> None:
        self.name, self.planned, self.device, self.periodic = planned.name, planned, device, periodic
        self.link = NetworkLink(planned.network_link)
        self._inputs, self._refusals = inputs, refusals
        self._ports = {port.name: port for port in planned.ports}
        self._streams = {port: f"{self.name}.{port}" for port in self._ports}
        self._places = {port: place for place, port in enumerate(self._ports)}
        self._sequence = dict.fromkeys(self._ports, 0)
        self._newest_ns = dict.fromkeys(self._ports, INITIAL)

    def write(self, time_ns: int, step: int, latencies: Latencies) -> None:
        """Write the arrivals from the simulation."""
        self.link.settle(time_ns)
        for port, valid_ns, value in self._pop_arrivals(time_ns, step):
            self._write_one(port, valid_ns, value)
            latencies.add("state to force", self._streams[port], time_ns - valid_ns)

    def _pop_arrivals(self, time_ns: int, step: int) -> Iterator[tuple[str, int, Value]]:
        """Yield port, time of validity (ns) and value of all values past the link by `time_ns`."""
        due = self._inputs.due(step)
        if self.link.idle:
            yield from sorted(due, key=lambda one: (self._places[one[0]], one[1]))
            return
        for port, valid_ns, value in due:
            self.link.line(self._ports[port]).send(valid_ns, (valid_ns, value))
        for port in self._ports.values():
            if port.causality == "input":
                for _, (valid_ns, value) in self.link.line(port).pop_arrivals(time_ns):
                    yield port.name, valid_ns, value

    def _write_one(self, port: str, valid_ns: int, value: Value) -> None:
        newest_ns = self._newest_ns[port]
        if valid_ns < newest_ns:
            late, newest = f"{valid_ns / 1e9:g} s", f"{newest_ns / 1e9:g} s"
            self._refusals.refuse(
                f"{self.name}.{port}", f"the value of {late} is late: that of {newest} arrived before it"
            )
            return
        self._newest_ns[port] = valid_ns
        self.device.write(port, value)

    def read(self, time_ns: int) -> Iterator[tuple[Sample, int, Stamp]]:
        """Yield the samples now at the hub: sample, time of arrival, stamp."""
        idle = self.link.idle
        for sample in self.device.read(time_ns):
            number = self._sequence[sample.port] = self._sequence[sample.port] + 1
            stamp = Stamp(0, number, time_ns)
            if idle:
                yield sample, time_ns, stamp
            else:
                self.link.line(self._ports[sample.port]).send(time_ns, (sample, stamp))
        for port in () if idle else self._ports.values():
            if port.causality == "output":
                for arrival_ns, (sample, stamp) in self.link.line(port).pop_arrivals(time_ns):
                    yield sample, arrival_ns, stamp


def open_device(name: str, device: Device, directory: Path) -> None:
    """Open a device; raises ParticipantError with the device's name."""
    try:
        device.open(directory)
    except Exception as error:
        raise ParticipantError(name, -1, f"cannot be opened: {error}") from error


def close_device(name: str, device: Device) -> None:
    """Close a device; an error is logged, and does not keep others open."""
    try:
        device.close()
    except Exception:
        log.exception("device '%s' raised while it was closed", name)
