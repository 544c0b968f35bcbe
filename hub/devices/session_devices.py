"""The devices of a session as its hub has them: their samples on the way to the grant, their links, and what
their hosts tell of them.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from time import monotonic_ns

import zenoh
from zenoh.handlers import Callback

from hub.devices.diagnostics_log import Complaints
from hub.devices.inlets import Inlets
from hub.devices.loop import DeviceLoop
from hub.devices.network_link_control import NetworkLinkControl
from hub.devices.simulated import SimulatedDevices
from hub.devices.uplink import DeviceUplink, Run
from hub.observation.observers import Observers
from hub.participant import Device, Sample
from hub.participant.token_bucket import TokenBucket
from hub.planning.plan import Plan
from hub.transport.envelope import Stamp
from hub.transport.reader import DeviceInputs
from hub.transport.refusals import Drops
from schemas.codec import decode
from schemas.errors import LateError, MessageError
from schemas.keys import Keys
from schemas.trocar_msgs import DeviceStatus, InletSample, Latency

__all__ = ["Intake"]

_SWITCH_S = 5e-4
"""How long a step may compute in Python before a device's sample is taken, instead of 5 ms: it brought the
median of `bench/latency.py` from 2.5 to 2.2 ms.
"""

_STATUSES = 10.0
"""How often the host of a device may tell of it, in a second; it does so once."""


class Intake:
    """Takes what devices say, wherever they live, and hands it to the clock at each communication point."""

    def __init__(self, plan: Plan, keys: Keys, run: int, drops: Drops, inlets: Inlets) -> None:
        """`drops` counts what is refused."""
        self._plan, self._keys, self._run, self._drops, self._inlets = plan, keys, run, drops, inlets
        self._connected = {(inlet.source, inlet.source_port) for inlet in plan.from_devices}
        self._statuses: dict[str, DeviceStatus] = {}
        self._latencies: dict[str, list[Latency]] = {}
        """What the host of each device told last, also of one that is gone."""
        self._time_ns = 0
        self._switch_s = sys.getswitchinterval()

    def lay(
        self,
        session: zenoh.Session,
        devices: Mapping[str, Device],
        feeds: Mapping[str, DeviceInputs],
        observers: Observers,
        failed: Callable[[str, str], None],
    ) -> None:
        """Lay out the `devices` of this process, and listen to those of others."""
        self._observers = observers
        participants = self._plan.participants
        simulated = {name: device for name, device in devices.items() if participants[name].simulated_time}
        self.simulated = SimulatedDevices(self._plan, simulated, feeds, self._drops)
        self._loops = {
            name: DeviceLoop(name, device, participants[name].read_ns, failed=failed)
            for name, device in devices.items()
            if name not in simulated
        }
        run = Run(self._plan, self._keys, self._run)
        self._uplinks = [
            DeviceUplink(participants[name], run, session, loop, self._drops)
            for name, loop in self._loops.items()
        ]
        for uplink, loop in zip(self._uplinks, self._loops.values(), strict=True):
            loop.attach(uplink)
        self.network_links = NetworkLinkControl(self._plan, session, self._keys, self.simulated.links)
        self._complaints = Complaints(self._plan, self._keys, session, self._drops)
        self._away = [m.name for m in participants.values() if m.role == "device" and m.host != "hub"]
        self._status_allowance = TokenBucket(_STATUSES * (1.0 + len(participants)))
        wall = [
            planned
            for planned in participants.values()
            if planned.role == "device" and not planned.simulated_time
        ]
        spoken = [
            (m.name, p.name)
            for m in wall
            for p in m.ports
            if p.causality == "output" and self._is_heard(m.name, p.name)
        ]
        self._subscribers = [
            session.declare_subscriber(self._keys.output("device", *source), self._listener(*source))
            for source in spoken
        ]
        self._subscribers.append(
            session.declare_subscriber(self._keys.device_status("*"), Callback(self._told, indirect=False))
        )

    def open(self, directory: Path) -> None:
        """Open the devices of this process, and begin to read those that live in wall time."""
        if self._away or self._loops:
            sys.setswitchinterval(_SWITCH_S)
        self.simulated.open(directory)
        for loop in self._loops.values():
            loop.start(directory)

    def enter(self, time_ns: int, step: int) -> list[InletSample]:
        """Return what enters the simulation at a communication point."""
        self._time_ns = time_ns
        self.simulated.exchange(time_ns, step, self._take)
        return self._inlets.sample(time_ns, monotonic_ns())

    def forget(self, device: str) -> None:
        """A device is gone: nothing is known of its clock any more."""
        self._inlets.offsets_ns.pop(device, None)
        self._statuses = {name: status for name, status in self._statuses.items() if name != device}

    @property
    def statuses(self) -> list[DeviceStatus]:
        """What is known of the devices that live in wall time."""
        return [status for _, status in sorted(self._statuses.items())]

    @property
    def latencies(self) -> list[Latency]:
        """How long samples took into the simulation, and its values out of it."""
        told = (latency for _, latencies in sorted(self._latencies.items()) for latency in latencies)
        return [*self._inlets.latencies.messages(), *self.simulated.latencies.messages(), *told]

    def _is_heard(self, device: str, port: str) -> bool:
        return (device, port) in self._connected or self._observers.watches(device, port)

    def _take(self, device: str, sample: Sample, payload: bytes, arrival_ns: int, stamp: Stamp) -> None:
        try:
            self._offer(device, sample.port, payload, arrival_ns, stamp)
        except LateError as error:
            self._drops.refuse(f"{device}.{sample.port}", error)

    def _offer(self, device: str, port: str, payload: bytes, now_ns: int, stamp: Stamp) -> None:
        enters = (device, port) in self._connected
        if enters:
            self._inlets.offer(device, port, payload, now_ns, stamp)
        if self._observers.watches(device, port):
            self._observers.device(device, port, self._time_ns, payload, enters=enters)

    def _listener(self, device: str, port: str) -> Callback[zenoh.Sample]:
        allowance = TokenBucket(self._plan.participants[device].rate_limit)

        def take(sample: zenoh.Sample) -> None:
            now_ns = monotonic_ns()
            try:
                if not allowance.spend(now_ns):
                    raise MessageError(
                        f"device '{device}' sends more than {allowance.rate:g} messages/s on port '{port}'"
                        " (rate_limit)"
                    )
                self._offer(device, port, sample.payload.to_bytes(), now_ns, Stamp.of(sample))
            except MessageError as error:
                self._drops.count(sample, error)

        return Callback(take, indirect=False)

    def _told(self, sample: zenoh.Sample) -> None:
        try:
            if not self._status_allowance.spend(monotonic_ns()):
                raise MessageError("devices tell of themselves more often than they may")
            status = decode(DeviceStatus, sample.payload.to_bytes())
            if (
                str(sample.key_expr) != self._keys.device_status(status.device)
                or status.device not in self._plan.participants
            ):
                raise MessageError(f"tells of '{status.device}', which is no device of this name here")
        except MessageError as error:
            self._drops.count(sample, error)
            return
        # a new one: others may be looking through the old one
        self._statuses = {**self._statuses, status.device: status}
        self._latencies = {**self._latencies, status.device: status.latencies}
        if status.round_trip_ns >= 0:
            self._inlets.offsets_ns[status.device] = status.offset_ns

    def close(self) -> None:
        """Close the devices of this process, and listen no more."""
        sys.setswitchinterval(self._switch_s)
        for loop in self._loops.values():
            loop.close()
        for uplink in self._uplinks:
            uplink.close()
        self.simulated.close()
        for entity in (*self._subscribers, self.network_links):
            entity.undeclare()
        self._complaints.close()
