"""A gateway to ROS, whatever the middleware: the base of kinds such as `ros2-zenoh`.

A gateway makes publishers, subscribers, services and ports from a table (`devices.ros.topics.dvrk_table`),
and knows no physics. A gateway for another middleware implements `connect` and returns another transport.
"""

from __future__ import annotations

import threading
from abc import abstractmethod
from collections import defaultdict, deque
from collections.abc import Collection
from math import inf
from pathlib import Path
from time import monotonic
from typing import ClassVar, cast

import numpy as np

from devices.ros.params import GatewayParams
from devices.ros.status import StatusCounters
from devices.ros.topics.arbitration import CommandArbiter
from devices.ros.topics.diagnostics import DIAGNOSTICS_PERIOD_NS, DIAGNOSTICS_ROW, Diagnostics
from devices.ros.topics.dvrk_table import dvrk_table
from devices.ros.topics.kinematics import kinematics_handler
from devices.ros.topics.publications import (
    Arrivals,
    EventTopic,
    PeriodicTopic,
    Publications,
    State,
    WantedTopic,
)
from devices.ros.topics.refusal_reports import RefusalReports
from devices.ros.topics.refused_moves import RefusedMoves
from devices.ros.topics.row import Row
from devices.ros.topics.subscriptions import SubscribedTopic
from devices.ros.topics.vrep_table import vrep_table
from devices.ros.topics.whole_robot import (
    inputs_of_all,
    periods_between,
    robot_description,
    whole_robot_sources,
)
from devices.ros.transport import Publisher, ServiceHandler, Transport
from devices.samples import stamp_of
from hub.participant import Device, Sample, Value, event_out
from robots.dvrk.mounted.mounted_mtm import MountedMtm
from robots.dvrk.mtm import BASE
from robots.dvrk.setup_joints import DrivenArm
from robots.transform import matrix_to_pose
from schemas.crtk import OperatingState
from schemas.errors import MessageError, did_you_mean
from schemas.keys import PLACE
from schemas.message import Message
from schemas.ports import Port
from schemas.ros import StringMessage
from schemas.trocar_msgs import GatewayStatus
from schemas.vectors import Vector

__all__ = ["Gateway"]

_ERRORS_OF_VREP = "stereo/error"
"""Error topic for the authors' simulator, which has no topic for errors."""
_NEWCOMER_S = 5.0
"""Time after a program has joined in which all states are used, s: it may want any at once."""
_REPORTS = ("error", "warning")
"""Topics of an arm with refusals."""
_STATUS_NS = 1_000_000_000


class Gateway(Device):
    """Shows the simulation to ROS programs, and passes their commands to it."""

    params_model = GatewayParams
    params: GatewayParams
    # for errors and the status; a message of a ROS program ends `wait` at once
    read_period_ns = 50_000_000
    kind: ClassVar[str]
    """Kind in a scenario, such as `ros2-zenoh`."""

    def __init__(self, name: str, params: GatewayParams) -> None:
        super().__init__(name, params)
        self.use_period_ns = params.publish_period
        self.rows = self.table()
        """All topics and services."""
        meaning = "once a second: who is connected, and the rates of all topics"
        self._status = event_out("gateway", GatewayStatus, meaning, clock="wall")
        place = "once a second: where programs reach it, by a router, a domain or a master"
        own = (self._status, event_out(PLACE, StringMessage, place, clock="wall"))
        self._ports = (*(row.port for row in self.rows if row.port is not None), *own)
        self._inputs = {
            row.port.name: row for row in self.rows if row.port is not None and row.way == "publish"
        }
        self._early: dict[str, Value] = {}
        """The last message on each latched topic from before the gateway was open."""
        self._transport: Transport | None = None
        self._reset()

    def _reset(self) -> None:
        """Start from nothing: no client, no message."""
        self._counters = StatusCounters(self.kind, self.rows)
        self._states: dict[str, State] = {}
        self._optional: list[tuple[State, Publisher]] = []
        """States used only while a program subscribes, with their publishers."""
        self._unused: frozenset[str] = frozenset()
        self._has_changed = True
        """Whether programs have subscribed, or have ceased to."""
        self._events: dict[str, EventTopic] = {}
        self._arbiters: defaultdict[str, CommandArbiter] = defaultdict(
            lambda: CommandArbiter(self._present_name)
        )
        self._refusals = RefusalReports(self.name, self._publish_text)
        self._refused_moves = RefusedMoves(self._publish)
        self._received: deque[Sample] = deque()
        self._is_new = threading.Event()
        """Set by a message or a subscription of a program."""
        self._status_due_ns = 0
        self._publications: Publications | None = None
        self._diagnostics: Diagnostics | None = None

    def table(self) -> tuple[Row, ...]:
        """Return the rows for the parameters."""
        return dvrk_table(self.params) if self.params.profile == "dvrk" else vrep_table(self.params)

    @abstractmethod
    def connect(self, directory: Path) -> Transport:
        """Join the ROS graph.

        Relative paths start at `directory`. Raises MissingExtraError or DeviceError on failure.
        """

    @property
    def ports(self) -> tuple[Port, ...]:
        """A port per topic, with the name of the topic, `gateway`, the status, and `place`."""
        return self._ports

    def open(self, directory: Path) -> None:
        """Join the ROS graph with every row of the table, and start to publish."""
        self.close()
        self._reset()
        self._transport = transport = self.connect(directory)
        transport.changed = self._note_programs
        self._publications = Publications(
            self.name, self._advertise_all(transport), self.params.publish_period
        )
        for port, value in self._early.items():
            self._note_value(self._inputs[port], value)
            self._events[port].write(value)
        self._early = {}
        for row in self.rows:
            if row.way == "subscribe":
                arbiter = self._arbiters[row.owner] if row.moves else None
                topic = SubscribedTopic(row, arbiter, self._counters[row], self._accept, self._refuse)
                transport.subscribe(row, topic.receive)
            elif row.way == "serve":
                transport.serve(row, self._service_handler(row))
        transport.announce_ready()

    def _advertise_all(self, transport: Transport) -> list[PeriodicTopic]:
        """Advertise all published rows; return the rows published at the gateway's period."""
        rows = [
            (row, transport.advertise(row), self._counters[row]) for row in self.rows if row.way == "publish"
        ]
        arrivals = Arrivals()
        self._states = {
            row.port.name: State(row.port, arrivals)
            for row, _, _ in rows
            if row.port is not None and row.periodic
        }
        self._diagnostics = Diagnostics(
            self.name, self._states, ((row, count) for row, _, count in rows if row.port is not None)
        )
        whole_robot = whole_robot_sources(self.params, self._states)
        always = inputs_of_all(self.params) if self.params.profile == "dvrk" else self._states.keys()
        periodic: list[PeriodicTopic] = []
        for row, publish, count in rows:
            if row.port is not None and row.periodic:
                state = self._states[row.port.name]
                periodic.append(WantedTopic(state, publish, count))
                if row.port.name not in always:
                    self._optional.append((state, publish))
            elif row.port is not None:
                self._events[row.port.name] = EventTopic(publish, count)
            elif row == DIAGNOSTICS_ROW:
                every = max(1, round(DIAGNOSTICS_PERIOD_NS / self.params.publish_period))
                periodic.append(PeriodicTopic(self._diagnostics, publish, count, every))
            elif row.name in whole_robot:
                every = periods_between(row.name, self.params.publish_period)
                periodic.append(WantedTopic(whole_robot[row.name], publish, count, every))
            elif self.params.robot_description is not None:
                urdf = robot_description(self.params.robot_description)
                EventTopic(publish, count).write(StringMessage(data=urdf))
        return periodic

    def _accept(self, row: Row, message: Message) -> None:
        if row.port is not None:
            self._refused_moves.accepted(row)
            self._received.append(Sample(row.port.name, message))
            self._is_new.set()

    def _present_name(self, client: str) -> str | None:
        return None if self._transport is None else self._transport.present_name(client)

    def _refuse(self, row: Row, level: str, reason: str) -> None:
        self._refusals.report(row, level, reason)
        self._refused_moves.refused(row)

    def _service_handler(self, row: Row) -> ServiceHandler:
        """Return the counting handler of an arm's service."""
        arm, count = self.params.arms.driven_arms[cast("DrivenArm", row.owner)], self._counters[row]
        if isinstance(arm, MountedMtm):
            bases = {"camera": BASE[arm.side], "base": np.eye(4), "world": arm.pose}
            pose = matrix_to_pose(bases[self.params.reference])
            handle = kinematics_handler(row, arm.chain, lambda: pose)
        else:
            state = self._states[f"SUJ/{row.owner}/measured_cp"]
            handle = kinematics_handler(row, arm.chain, lambda: state.value, state.port.name)

        def count_payload(payload: bytes) -> bytes:
            count.messages += 1
            return handle(payload)

        return count_payload

    def read(self, t: int) -> list[Sample]:
        """Return the messages of ROS programs since the last call, and the status once a second."""
        if self._publications is not None:
            self._publications.check()
        self._is_new.clear()
        if self._has_changed or t >= self._status_due_ns:
            self._has_changed = False
            self._update_used()
        samples = [self._received.popleft() for _ in range(len(self._received))]
        if self._transport is not None and t >= self._status_due_ns:
            self._status_due_ns = t + _STATUS_NS
            samples.append(Sample(PLACE, StringMessage(data=self._transport.endpoint)))
            samples.append(Sample(self._status.name, self._counters.status(self._transport.clients())))
        return samples

    def wait(self, seconds: float) -> bool:
        """Wait for a message or a subscription of a ROS program; return whether the wait was successful."""
        return self._is_new.wait(seconds)

    def unused(self) -> Collection[str]:
        """Return the states without a subscriber and without use in the gateway itself."""
        return self._unused

    def _note_programs(self) -> None:
        self._has_changed = True
        self._is_new.set()

    def _update_used(self) -> None:
        joined_s = -inf if self._transport is None else self._transport.joined_s
        is_new = monotonic() - joined_s < _NEWCOMER_S
        for state, publish in self._optional:
            # the first value is awaited: by it the topic counts as published
            state.use(used=is_new or publish.wanted or not state.writes)
        unused = frozenset(state.port.name for state, _ in self._optional if not state.used)
        if unused != self._unused:
            self._unused = unused

    def write(self, port: str, value: Value) -> None:
        """Set the newest value of a state, or publish a message. Never blocks."""
        if (state := self._states.get(port)) is not None:
            state.write(cast("Vector", value))
            return
        row = self._inputs.get(port)
        if row is None:
            raise MessageError(
                f"device '{self.name}' has no input '{port}'.{did_you_mean(port, self._inputs)}"
            )
        self._note_value(row, value)
        if port in self._events:
            self._events[port].write(value)
        elif row.latched:
            self._early[port] = value

    def _note_value(self, row: Row, value: Value) -> None:
        """Note operating states, refusals and the simulated time, before their publication."""
        if row.name in _REPORTS:
            for message in value if isinstance(value, tuple) else (value,):
                if isinstance(message, StringMessage):
                    self._counters.note_report(row.owner, message.data)
        if row.name == "operating_state" and isinstance(value, OperatingState):
            self._arbiters[row.owner].busy = value.is_busy
            self._refused_moves.update(row.owner, value)
        if self._diagnostics is not None and isinstance(value, Message) and (stamp_ns := stamp_of(value)):
            self._diagnostics.note_stamp(stamp_ns)

    def _publish(self, port: str, message: Message) -> None:
        if (event := self._events.get(port)) is not None:
            event.write(message)

    def _publish_text(self, port: str, text: StringMessage) -> None:
        """Publish a text of the gateway itself, if the owner has a topic for the text."""
        owner = port.rpartition("/")[0]
        for topic in (port, f"{owner}/warning", f"{owner}/status", _ERRORS_OF_VREP):
            if (event := self._events.get(topic)) is not None:
                event.write(text)
                return

    def close(self) -> None:
        """Leave the graph."""
        if self._publications is not None:
            self._publications.close()
        if self._transport is not None:
            self._transport.close()
        self._publications = self._transport = None
        self._states, self._events = {}, {}
        self._optional, self._unused = [], frozenset()
