"""The hub's side of a session's devices: samples on the way to the grant, and statuses."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from time import monotonic_ns

import zenoh
from zenoh.handlers import Callback

from hub.devices.device_statuses import DeviceStatuses
from hub.devices.device_thread import DeviceThread
from hub.devices.diagnostics_log import DiagnosticsLog
from hub.devices.inlets import Inlets
from hub.devices.network_link_control import NetworkLinkControl
from hub.devices.simulated_devices import SimulatedDevices
from hub.devices.uplink import DeviceUplink
from hub.observation.monitor import Monitor
from hub.participant import Device, Sample
from hub.participant.token_bucket import TokenBucket
from hub.transport.envelope import Stamp
from hub.transport.reader import DeviceInputs
from hub.transport.run_connection import RunConnection
from schemas.errors import LateError, MessageError
from schemas.lockstep import Entering
from schemas.trocar_msgs import DeviceStatus, Latency

__all__ = ["SessionDevices"]

_SWITCH_S = 5e-4
"""How long a step may compute in Python before a device's sample is received, instead of 5 ms.

The value brought the median of `bench/latency.py` from 2.5 to 2.2 ms.
"""


class SessionDevices:
    """Receives the samples of all devices, and enters them at each communication point.

    Args:
        run: The connection to the run.
        devices: The devices of this process, not yet open.
        inputs: The values for devices of this process in simulated time.
        monitor: Records and measures device samples.
        failed: Called with the name and the cause after a failure of a device.
    """

    def __init__(
        self,
        run: RunConnection,
        devices: Mapping[str, Device],
        inputs: Mapping[str, DeviceInputs],
        monitor: Monitor,
        failed: Callable[[str, str], None],
    ) -> None:
        plan, participants = run.plan, run.plan.participants
        self._plan, self._monitor, self._refusals = plan, monitor, run.refusals
        self._connected = {(inlet.source, inlet.source_port) for inlet in plan.from_devices}
        self._time_ns = 0
        self._switch_s = sys.getswitchinterval()
        self.inlets = Inlets(plan)
        simulated = {name: device for name, device in devices.items() if participants[name].simulated_time}
        self._simulated = SimulatedDevices(plan, simulated, inputs, run.refusals)
        self._threads = {
            name: DeviceThread(name, device, participants[name].read_ns, failed=failed)
            for name, device in devices.items()
            if name not in simulated
        }
        self._uplinks: list[DeviceUplink] = []
        for name, thread in self._threads.items():
            uplink = DeviceUplink(participants[name], run, thread)
            self._uplinks.append(uplink)
            thread.attach(uplink)
        self.network_links = NetworkLinkControl(run, self._simulated.links)
        self._diagnostics = DiagnosticsLog(run)
        self._statuses = DeviceStatuses(run, self.inlets)
        self._subscribers = [
            run.session.declare_subscriber(run.keys.output("device", *source), self._listener(*source))
            for source in self._used_outputs()
        ]

    def _used_outputs(self) -> list[tuple[str, str]]:
        """Return device and port of every connected or watched output of a wall-time device."""
        outputs = [
            (planned.name, port.name)
            for planned in self._plan.participants.values()
            if planned.role == "device" and not planned.simulated_time
            for port in planned.ports
            if port.causality == "output"
        ]
        return [source for source in outputs if source in self._connected or self._monitor.watches(*source)]

    def open(self, directory: Path) -> None:
        """Open the devices of this process, and start reading the wall-time devices."""
        away = any(p.role == "device" and p.host != "hub" for p in self._plan.participants.values())
        if away or self._threads:
            sys.setswitchinterval(_SWITCH_S)
        self._simulated.open(directory)
        for thread in self._threads.values():
            thread.start(directory)

    def enter_samples(self, time_ns: int, step: int) -> list[Entering]:
        """Return the entries into the simulation at a communication point."""
        self._time_ns = time_ns
        self._simulated.exchange(time_ns, step, self._enter_sample)
        return self.inlets.sample(time_ns, monotonic_ns())

    def forget(self, device: str) -> None:
        """Forget the clock and the status of a departed device."""
        self._statuses.forget(device)

    @property
    def statuses(self) -> list[DeviceStatus]:
        """The last status of each wall-time device."""
        return self._statuses.statuses

    @property
    def latencies(self) -> list[Latency]:
        """Latencies of samples into the simulation, and of values out of the simulation."""
        own = *self.inlets.latencies.messages(), *self._simulated.latencies.messages()
        return [*own, *self._statuses.latencies]

    def _enter_sample(self, device: str, sample: Sample, arrival_ns: int, stamp: Stamp) -> None:
        source = device, sample.port
        enters = source in self._connected
        if not enters and not self._monitor.watches(*source):
            return
        payload = sample.encode()
        try:
            if enters:
                self.inlets.offer(*source, payload, arrival_ns, stamp)
            self._monitor.device_here(device, sample, self._time_ns, payload, enters=enters)
        except LateError as error:
            self._refusals.refuse(f"{device}.{sample.port}", error)

    def _offer(self, device: str, port: str, payload: bytes, now_ns: int, stamp: Stamp) -> None:
        enters = (device, port) in self._connected
        if enters:
            self.inlets.offer(device, port, payload, now_ns, stamp)
        if self._monitor.watches(device, port):
            self._monitor.device(device, port, self._time_ns, payload, enters=enters)

    def _listener(self, device: str, port: str) -> Callback[zenoh.Sample]:
        limit = TokenBucket(self._plan.participants[device].rate_limit)

        def receive(sample: zenoh.Sample) -> None:
            now_ns = monotonic_ns()
            try:
                if not limit.spend(now_ns):
                    raise MessageError(
                        f"device '{device}' sends more than {limit.rate:g} messages/s on port '{port}'"
                        " (rate_limit)"
                    )
                self._offer(device, port, sample.payload.to_bytes(), now_ns, Stamp.of(sample))
            except MessageError as error:
                self._refusals.refuse_sample(sample, error)

        return Callback(receive, indirect=False)

    def close(self) -> None:
        """Close the devices of this process, and receive no more."""
        sys.setswitchinterval(self._switch_s)
        for uplink in self._uplinks:  # before the devices: an uplink writes to its device until closed
            uplink.close()
        for thread in self._threads.values():
            thread.close()
        self._simulated.close()
        for entity in (*self._subscribers, self._statuses, self.network_links, self._diagnostics):
            entity.undeclare()
