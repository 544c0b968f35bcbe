"""A wall-time device's connection to the hub in a run: sends samples and reports the device's status."""

from __future__ import annotations

from time import monotonic_ns

import zenoh
from pydantic import ValidationError
from zenoh.handlers import Callback

from hub.devices.clock_offset import ClockOffset
from hub.devices.device_receiver import DeviceReceiver
from hub.devices.device_thread import DeviceThread
from hub.devices.network_link import NetworkLink, NetworkLinkOrder, describe_link
from hub.participant import Sample
from hub.planning.plan import PlannedParticipant
from hub.transport.control_text import control_text
from hub.transport.envelope import Stamp
from hub.transport.run_connection import RunConnection
from schemas.codec import encode
from schemas.errors import MessageError
from schemas.ports import Port
from schemas.trocar_msgs import DeviceStatus

__all__ = ["DeviceUplink"]

_STATUS_NS = 1_000_000_000


class DeviceUplink:
    """Publishes a device's samples, and writes the values of connections to the device, until closed.

    Args:
        planned: The device.
        run: The connection to the run.
        thread: The reading thread of the device.
        offset: Offset of the hub's clock; None in the hub's own process.
    """

    def __init__(
        self,
        planned: PlannedParticipant,
        run: RunConnection,
        thread: DeviceThread,
        offset: ClockOffset | None = None,
    ) -> None:
        name, session, keys = planned.name, run.session, run.keys
        self._name, self._run, self._thread, self._offset = name, run, thread, offset
        self._link = NetworkLink(planned.network_link)
        self._reported_ns = -_STATUS_NS
        self._is_offset_reported = offset is None
        self._sequence = {port.name: 0 for port in planned.ports}
        outputs = [port for port in planned.ports if port.causality == "output"]
        self._publishers = {
            port.name: _create_publisher(session, keys.output("device", name, port.name), port)
            for port in outputs
        }
        self._lines = {port.name: self._link.line(port) for port in outputs}
        self._status = session.declare_publisher(
            keys.device_status(name), encoding=zenoh.Encoding.APPLICATION_CDR
        )
        self._receiver = DeviceReceiver(name, run, self._link, thread, offset)
        self._link_orders = session.declare_subscriber(
            keys.link(name), Callback(self._change_network_link, indirect=True)
        )

    def exchange(self, t: int, samples: list[Sample]) -> bool:
        """Send the samples read at `t` (ns since the thread's start), and write the arrivals to the device.

        Returns whether the network link delays anything, and the next call must come soon.
        """
        self._link.settle(t)
        now_ns, idle = monotonic_ns(), self._link.idle
        for sample in samples:
            number = self._sequence[sample.port] = self._sequence[sample.port] + 1
            stamped = sample.encode(), Stamp(self._run.admission, number, now_ns).pack()
            if idle:
                self._publish(sample.port, *stamped)
            else:
                self._lines[sample.port].send(t, stamped)
        if not idle:
            for name, line in self._lines.items():
                for _, stamped in line.pop_arrivals(t):
                    self._publish(name, *stamped)
            self._receiver.write_arrived(t)
        # the hub measures no latency before it knows the offset, so the first one is reported at once
        if now_ns - self._reported_ns >= _STATUS_NS or self._has_first_offset():
            self._reported_ns = now_ns
            self._report_status()
            self._receiver.want_all_but(
                self._thread.unused_signals(), again=True
            )  # a source may have come later
        else:
            self._receiver.want_all_but(self._thread.unused_signals())
        return not idle

    def _publish(self, port: str, payload: bytes, stamp: bytes) -> None:
        self._publishers[port].put(payload, attachment=stamp)

    def _has_first_offset(self) -> bool:
        return not self._is_offset_reported and self._offset is not None and self._offset.best is not None

    def _report_status(self) -> None:
        best = None if self._offset is None else self._offset.best
        offset_ns, round_trip_ns = (0, -1) if best is None else (best.offset_ns, best.round_trip_ns)
        self._is_offset_reported |= best is not None
        status = DeviceStatus(
            device=self._name,
            offset_ns=offset_ns,
            round_trip_ns=round_trip_ns,
            link=describe_link(self._link.spec),
            latencies=self._receiver.latencies.messages(),
        )
        self._status.put(encode(status))

    def _change_network_link(self, sample: zenoh.Sample) -> None:
        try:
            self._link.order(NetworkLinkOrder.model_validate_json(control_text(sample.payload.to_bytes())))
        except (MessageError, ValidationError) as error:
            self._run.refusals.refuse_sample(sample, error)

    def close(self) -> None:
        """Report the device's status a last time, and send and receive no more."""
        self._thread.attach(None)
        self._report_status()
        self._link_orders.undeclare()
        self._receiver.close()
        for publisher in (*self._publishers.values(), self._status):
            publisher.undeclare()


def _create_publisher(session: zenoh.Session, key: str, port: Port) -> zenoh.Publisher:
    """Return the publisher of an output.

    Signals go first, and are dropped where the network is congested; events wait in a queue of their own.
    """
    if port.variability == "event":
        priority, congestion = zenoh.Priority.INTERACTIVE_HIGH, zenoh.CongestionControl.BLOCK
    else:
        priority, congestion = zenoh.Priority.REAL_TIME, zenoh.CongestionControl.DROP
    return session.declare_publisher(
        key,
        encoding=zenoh.Encoding.APPLICATION_CDR,
        priority=priority,
        congestion_control=congestion,
        express=True,
    )
