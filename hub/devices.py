"""Devices in a session: those that live in wall time run in a thread of their host, those that play by a script follow the clock."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from time import monotonic_ns

import zenoh
from zenoh.handlers import Callback

from hub.cells import INITIAL
from hub.inlets import Inlets
from hub.participant import Device
from hub.plan import Member, Plan
from hub.wire import Drops, PortCodec, Tag
from schemas.codec import encode
from schemas.errors import MessageError, ParticipantError
from schemas.keys import Keys
from schemas.ports import Port

__all__ = ["DeviceLoop", "ScriptedDevices"]

log = logging.getLogger(__name__)


class ScriptedDevices:
    """The devices of the hub's process that are read at every communication point."""

    def __init__(self, devices: Mapping[str, Device]) -> None:
        self._devices = dict(devices)

    def open(self, directory: Path) -> None:
        """Open all; raises ParticipantError naming the one that cannot be."""
        for name, device in self._devices.items():
            _open(name, device, directory)

    def read(self, time_ns: int, step: int, inlets: Inlets) -> None:
        """Offer all samples up to `time_ns` to the inlets; their age is counted in simulated time."""
        for name, device in self._devices.items():
            try:
                for sample in device.read(time_ns):
                    inlets.offer(name, sample.port, encode(sample.message), time_ns)
            except Exception as error:
                raise ParticipantError(name, step, f"{type(error).__name__}: {error}") from error

    def close(self) -> None:
        """Close all."""
        for device in self._devices.values():
            device.close()


class DeviceLoop:
    """Reads a device at its period in a thread of its own, and writes to it what the simulation has for it."""

    def __init__(
        self, member: Member, plan: Plan, device: Device, session: zenoh.Session, keys: Keys, drops: Drops, *, failed: Callable[[str, str], None]
    ) -> None:
        """`drops` counts what the device is not given; `failed` is told the device's name and the cause when the loop ends by an error."""
        self._name = member.name
        self._device = device
        self._period_s = member.period * plan.step_ns / 1e9
        self._failed = failed
        self._drops = drops
        self._ending = threading.Event()
        self._publishers = {
            port.name: session.declare_publisher(keys.output("device", member.name, port.name), encoding=zenoh.Encoding.APPLICATION_CDR, express=True)
            for port in member.ports
            if port.causality == "output"
        }
        self._subscribers = [
            self._subscribe(session, keys, plan, outlet.source, outlet.source_port, member.port(outlet.device_port))
            for outlet in plan.outlets
            if outlet.device == member.name
        ]
        self._thread = threading.Thread(target=self._run, name=f"device {member.name}", daemon=True)

    def start(self, directory: Path) -> None:
        """Open the device and begin to read it."""
        _open(self._name, self._device, directory)
        self._thread.start()

    def _subscribe(self, session: zenoh.Session, keys: Keys, plan: Plan, source: str, source_port: str, port: Port) -> zenoh.Subscriber[None]:
        member = plan.members[source]
        codec = PortCodec(member.port(source_port).model_copy(update={"variability": port.variability}))

        newest = (INITIAL - 1, 0)

        def write(sample: zenoh.Sample) -> None:
            nonlocal newest
            try:
                tag = Tag.of(sample)
                if not tag.count or (tag.step, tag.index) <= newest:  # no events, or the value at time 0 again
                    return
                newest = tag.step, tag.index
                self._device.write(port.name, codec.decode(sample.payload.to_bytes()))
            except MessageError as error:
                self._drops.count(sample, error)

        return session.declare_subscriber(keys.output(member.key_role, source, source_port), Callback(write, indirect=True))

    def _run(self) -> None:
        start_ns = monotonic_ns()
        try:
            while not self._ending.wait(self._period_s):
                for sample in self._device.read(monotonic_ns() - start_ns):
                    self._publishers[sample.port].put(encode(sample.message))
        except Exception as error:
            log.exception("device '%s' has failed", self._name)
            self._failed(self._name, f"{type(error).__name__}: {error}")

    def close(self) -> None:
        """End the loop and close the device."""
        self._ending.set()
        if self._thread.is_alive():
            self._thread.join(timeout=2.0)
        for entity in (*self._subscribers, *self._publishers.values()):
            entity.undeclare()
        self._device.close()


def _open(name: str, device: Device, directory: Path) -> None:
    try:
        device.open(directory)
    except Exception as error:
        raise ParticipantError(name, -1, f"cannot be opened: {error}") from error
