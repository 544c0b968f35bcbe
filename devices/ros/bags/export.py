"""Writes a session's recording as a bag with ROS names: messages published and received by the gateway.

Times are the session's start by the wall clock plus simulated time, in stamps too: a bag plays at the pace of
simulated time, whatever the speed of the session (docs/decisions/0033-bags.md).
"""

from __future__ import annotations

import logging
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from devices.ros.bags.implied_gateway import implied_gateway, implied_routes
from devices.ros.gateway import Gateway
from devices.ros.topics.publications import MessageSource, State
from devices.ros.topics.row import Row
from devices.ros.topics.stamps import Stamps
from devices.ros.topics.whole_robot import periods_between, robot_description, whole_robot_sources
from devices.samples import stamp_message
from hub.planning import registry
from hub.planning.foreign_code import names_class
from hub.planning.plan import Plan
from hub.recording.recording import Recording
from hub.recording.ros_bag_writer import BagWriter
from hub.recording.time_order import messages_by_time
from hub.recording.trust import trusted_parameters
from hub.transport.port_codec import PortCodec
from schemas.codec import decode, encode, message_type
from schemas.errors import DeviceError, MessageError, RecordingError, did_you_mean
from schemas.keys import Keys, topic
from schemas.message import Message
from schemas.ports import Port
from schemas.ros import StringMessage
from schemas.vectors import Vector

__all__ = ["ExportSummary", "export"]

log = logging.getLogger(__name__)

_KEYS = Keys("any")
_Routes = Mapping[str, Sequence[tuple[Row, Port]]]
"""Receiving rows by topic of a recording, each with the port of the written values."""


_LONGEST_GAP_NS = 3_600_000_000_000
"""Longest time between two messages: states are repeated at each period, so a wrong time would fill the disk.
"""


@dataclass(frozen=True)
class ExportSummary:
    """Summary of an export."""

    bag: str
    gateway: str
    topics: int
    messages: int
    duration_s: float


def export(
    recording: Recording,
    directory: Path,
    gateway: str | None = None,
    *,
    pictures: bool = True,
    trust: bool = False,
) -> ExportSummary:
    """Write the messages published and received by a gateway of a recorded session to a new `directory`.

    Args:
        recording: the recording of the session.
        directory: the bag, not existing yet.
        gateway: the gateway's name; by default the session's only gateway, and in a session without one
            a gateway for the arms of its motion controller.
        pictures: whether pictures are written.
        trust: allow requests refused by `trusted_parameters`.

    Raises:
        RecordingError: if the session has no such gateway, if the directory exists or cannot be written,
            or if the recording is damaged.
        ScenarioError: if the gateway's kind is not installed.
        TrustError: if the gateway, or without a name any device, asks for forbidden files or code.
    """
    plan = recording.plan()
    shown, planned = _gateway_routes(recording, plan, gateway, trust=trust)
    routes = {
        name: kept
        for name, rows in planned.items()
        if name in recording.topics and (kept := [one for one in rows if pictures or not one[0].is_picture])
    }
    with BagWriter(directory) as bag:
        replay, last_ns = _Replay(shown, routes, _RowWriter(bag, recording.started_ns())), -1
        for message in messages_by_time(recording, *routes):
            if message.time_ns - max(last_ns, 0) > _LONGEST_GAP_NS:
                raise RecordingError(
                    f"'{recording.file}': nothing from {max(last_ns, 0) * 1e-9:g} s to"
                    f" {message.time_ns * 1e-9:g} s; at most {_LONGEST_GAP_NS * 1e-9:g} s are allowed"
                )
            last_ns = max(last_ns, message.time_ns)
            try:
                replay.publish_before(message.time_ns)
                for row, source in routes[message.topic]:
                    replay.write(row, source, message.time_ns, message.payload)
            except MessageError as error:
                raise RecordingError(
                    f"'{recording.file}': topic '{message.topic}' at {message.time_ns} ns: {error}"
                ) from error
        replay.publish_before(last_ns + 1)
    return ExportSummary(str(directory), shown.name, bag.topics, bag.messages, recording.duration_ns * 1e-9)


def _gateway_routes(
    recording: Recording, plan: Plan, name: str | None, *, trust: bool
) -> tuple[Gateway, _Routes]:
    """Return the gateway with this name, or the only or the implied gateway, and the rows."""
    kinds = (planned.kind for planned in plan.participants.values() if planned.role == "device")
    if name is None and not any(
        names_class(kind) or issubclass(registry.load(kind), Gateway) for kind in kinds
    ):
        implied = implied_gateway(recording, plan, trust=trust)
        if implied is not None:
            return implied, implied_routes(plan, implied)
    shown = _gateway(recording, plan, name, trust=trust)
    return shown, _recorded_routes(plan, shown)


def _gateway(recording: Recording, plan: Plan, name: str | None, *, trust: bool) -> Gateway:
    """Return the gateway with this name, or the only gateway, as declared in the scenario."""
    devices = {key: planned for key, planned in plan.participants.items() if planned.role == "device"}
    classes = {key: planned for key, planned in devices.items() if names_class(planned.kind)}
    there = [
        key
        for key, planned in devices.items()
        if (trust or key not in classes) and issubclass(registry.load(planned.kind), Gateway)
    ]
    if not trust and (name in classes or not there):  # one of these may be the gateway that is meant
        trusted_parameters(recording, classes)
    if name is None and len(there) != 1:
        none = (
            "neither a gateway to ROS nor a participant of kind `motion`, which would define its topics: add"
            " one to the scenario and record again"
        )
        found = (
            f"{len(there)} gateways to ROS ({', '.join(there)}): say which by --gateway" if there else none
        )
        raise RecordingError(f"session '{recording.session()}' in '{recording.file}' has {found}")
    if name is not None and name not in there:
        raise RecordingError(
            f"session '{recording.session()}' in '{recording.file}' has no gateway"
            f" '{name}'.{did_you_mean(name, there)}"
        )
    meant = there[0] if name is None else name
    made, _ = trusted_parameters(recording, [meant], trust=trust).make(meant)
    if not isinstance(made, Gateway):
        raise TypeError(f"{made} is not a gateway, though its kind is one of gateways")
    return made


def _recorded_routes(plan: Plan, gateway: Gateway) -> _Routes:
    rows = {row.port.name: row for row in gateway.rows if row.port is not None}
    routes: defaultdict[str, list[tuple[Row, Port]]] = defaultdict(list)
    for connection in plan.to_devices:
        if connection.target == gateway.name:
            source = plan.participants[connection.source].port(connection.source_port)
            routes[topic(_KEYS.output("engine", connection.source, source.name))].append(
                (rows[connection.target_port], source)
            )
    for row in rows.values():
        if row.way == "subscribe" and row.port is not None:
            routes[topic(_KEYS.output("device", gateway.name, row.port.name))].append((row, row.port))
    return routes


class _Recorded(State):
    """The newest recorded value of a state."""

    def __init__(self, port: Port, source: Port) -> None:
        """`port`: port of the gateway; `source`: port of the written values."""
        super().__init__(port)
        self._reader = PortCodec(port.filled_from(source))
        self.payload: bytes | None = None

    @property
    def value(self) -> Vector | None:
        """The newest value, however old; None before the first."""
        return None if self.payload is None else self._reader.accept(self.payload)


class _RowWriter:
    """Writes messages of a gateway's rows to a bag, with simulated times as times of the wall clock."""

    def __init__(self, bag: BagWriter, start_ns: int) -> None:
        """`start_ns`: wall time of simulated time 0."""
        self._bag, self._start_ns = bag, start_ns
        self._stamps: defaultdict[str, Stamps] = defaultdict(Stamps)

    def stamp_ns(self, row: Row, time_ns: int) -> int:
        """Return the stamp of a message at simulated time `time_ns`."""
        return self._stamps[row.topic].after(self._start_ns + time_ns)

    def write(self, row: Row, time_ns: int, message: Message) -> None:
        """Stamp and write a message. Raises RecordingError if the bag cannot be written."""
        self.write_cdr(row, time_ns, encode(stamp_message(message, self.stamp_ns(row, time_ns))))

    def write_cdr(self, row: Row, time_ns: int, payload: bytes) -> None:
        """Write a stamped and encoded message."""
        self._bag.write(row.topic, row.type, self._start_ns + time_ns, payload, latched=row.latched)


class _Replay:
    """Publishes recorded states at the gateway's period in simulated time, and events at their times."""

    def __init__(self, gateway: Gateway, routes: _Routes, bag: _RowWriter) -> None:
        self._bag, self._period_ns, self._due_ns = bag, gateway.params.publish_period, 0
        sources = {row.topic: source for rows in routes.values() for row, source in rows}
        periodic = [(row, row.port) for row in gateway.rows if row.periodic and row.port is not None]
        self._recorded = {
            row.topic: _Recorded(port, sources[row.topic]) for row, port in periodic if row.topic in sources
        }
        states: dict[str, State] = {
            port.name: self._recorded.get(row.topic) or State(port) for row, port in periodic
        }
        whole_robot = whole_robot_sources(gateway.params, states)
        self._periodic: list[tuple[Row, MessageSource, int]] = [
            (row, states[port.name], 1) for row, port in periodic if row.topic in sources
        ]
        for row in gateway.rows:
            if row.name in whole_robot:
                every = periods_between(row.name, self._period_ns)
                self._periodic.append((row, whole_robot[row.name], every))
            elif row.name == "robot_description" and gateway.params.robot_description is not None:
                self._write_description(row, gateway.params.robot_description)

    def _write_description(self, row: Row, file: Path) -> None:
        try:
            self._bag.write(row, 0, StringMessage(data=robot_description(file)))
        except DeviceError as error:
            log.warning("the bag is without %s: %s", row.topic, error)

    def write(self, row: Row, source: Port, time_ns: int, payload: bytes) -> None:
        """Set a state's newest value, or write an event. Raises MessageError for an invalid payload."""
        if row.topic in self._recorded:
            self._recorded[row.topic].payload = payload
        # a signal's value at time 0 is its initial value, and no message
        elif row.way == "subscribe" or source.variability == "event" or time_ns > 0:
            self._bag.write(row, time_ns, decode(message_type(row.type), payload))

    def publish_before(self, time_ns: int) -> None:
        """Publish the newest of every state at each period before `time_ns`. Raises MessageError."""
        while self._due_ns < time_ns:
            period = self._due_ns // self._period_ns
            for row, source, every in self._periodic:
                if (
                    period % every == 0
                    and (payload := source.cdr(self._bag.stamp_ns(row, self._due_ns))) is not None
                ):
                    self._bag.write_cdr(row, self._due_ns, payload)
            self._due_ns += self._period_ns
