"""Reports of the hosts of wall-time devices: clock offsets, network links and latencies."""

from __future__ import annotations

from time import monotonic_ns

import zenoh
from zenoh.handlers import Callback

from hub.devices.inlets import Inlets
from hub.participant.token_bucket import TokenBucket
from hub.transport.run_connection import RunConnection
from schemas.codec import decode
from schemas.errors import MessageError
from schemas.trocar_msgs import DeviceStatus, Latency

__all__ = ["DeviceStatuses"]

_RATE = 10.0
"""Statuses per second accepted for each participant; a host sends a status of each device."""


class DeviceStatuses:
    """Receives the statuses of all devices, and gives their clock offsets to the inlets."""

    def __init__(self, run: RunConnection, inlets: Inlets) -> None:
        self._run, self._inlets = run, inlets
        self._statuses: dict[str, DeviceStatus] = {}
        self._latencies: dict[str, list[Latency]] = {}
        """The last latencies of each device, also of a device already gone."""
        self._limit = TokenBucket(_RATE * (1.0 + len(run.plan.participants)))
        self._subscriber = run.session.declare_subscriber(
            run.keys.device_status("*"), Callback(self._receive, indirect=False)
        )

    @property
    def statuses(self) -> list[DeviceStatus]:
        """The last status of each present device, by name."""
        return [status for _, status in sorted(self._statuses.items())]

    @property
    def latencies(self) -> list[Latency]:
        """How long values took to the devices."""
        return [latency for _, its in sorted(self._latencies.items()) for latency in its]

    def _receive(self, sample: zenoh.Sample) -> None:
        try:
            if not self._limit.spend(monotonic_ns()):
                raise MessageError("devices report their status more often than they may")
            status = decode(DeviceStatus, sample.payload.to_bytes())
            if (
                str(sample.key_expr) != self._run.keys.device_status(status.device)
                or status.device not in self._run.plan.participants
            ):
                raise MessageError(f"reports on '{status.device}', which is no device of this name here")
        except MessageError as error:
            self._run.refusals.refuse_sample(sample, error)
            return
        # new dictionaries: other threads may be iterating over the old ones
        self._statuses = {**self._statuses, status.device: status}
        self._latencies = {**self._latencies, status.device: status.latencies}
        if status.round_trip_ns >= 0:
            self._inlets.offsets_ns[status.device] = status.offset_ns

    def forget(self, device: str) -> None:
        """Forget the status and the clock offset of a departed device."""
        self._inlets.offsets_ns.pop(device, None)
        self._statuses = {name: status for name, status in self._statuses.items() if name != device}

    def undeclare(self) -> None:
        """Receive no more."""
        self._subscriber.undeclare()
