"""A gateway to ROS, whatever the middleware: the base of kinds such as `ros2-zenoh`.

It makes publishers, subscribers, services and ports from one table (`devices.ros.topics.face`), and knows no
physics. A gateway for another middleware is a `connect` that returns another transport.
"""

from __future__ import annotations

import threading
from abc import abstractmethod
from collections import defaultdict, deque
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar, cast

from devices.ros.params import GatewayParams
from devices.ros.topics.commander import Commander
from devices.ros.topics.description import description
from devices.ros.topics.face import face
from devices.ros.topics.incoming import Incoming
from devices.ros.topics.kinematics import kinematics_handler
from devices.ros.topics.outgoing import Event, Outgoing, Periodic, Source, State
from devices.ros.topics.refusals import Refusals
from devices.ros.topics.row import Row
from devices.ros.topics.scenery import scenery, stride
from devices.ros.topics.vrep import paper_face
from devices.ros.traffic import Traffic
from devices.ros.transport import Handler, Transport
from hub.participant import Device, Sample, Value
from robots.dvrk.setup_joints import CartArm
from schemas.crtk import OperatingState
from schemas.errors import MessageError, did_you_mean
from schemas.message import Message
from schemas.ports import Port
from schemas.ros import StringMessage
from schemas.trocar_msgs import GatewayStatus
from schemas.vectors import Vector

__all__ = ["Gateway"]

_STATUS_NS = 1_000_000_000


class Gateway(Device):
    """Shows the simulation to ROS programs, and brings what they command into it."""

    params_model = GatewayParams
    params: GatewayParams
    read_period_ns = 50_000_000  # for what goes wrong, and the status: what programs say is read as it comes
    kind: ClassVar[str]
    """As the scenario calls it: `ros2-zenoh`."""

    def __init__(self, name: str, params: GatewayParams) -> None:
        """Take the participant's name and its parameters."""
        super().__init__(name, params)
        self.rows = self.table()
        """All topics and services."""
        told = "once a second: who is connected, and what goes through"
        self._status = Port(
            name="gateway",
            causality="output",
            type=GatewayStatus.ros_type,
            variability="event",
            clock="wall",
            description=told,
        )
        self._ports = (*(row.port for row in self.rows if row.port is not None), self._status)
        self._inputs = {
            row.port.name: row for row in self.rows if row.port is not None and row.way == "publish"
        }
        self._early: dict[str, Value] = {}
        """The last message on each latched topic from before the gateway was open."""
        self._transport: Transport | None = None
        self._forget()

    def _forget(self) -> None:
        """Begin anew: nobody is there, nothing was said."""
        self._traffic = Traffic(self.kind, self.rows)
        self._states: dict[str, State] = {}
        self._events: dict[str, Event] = {}
        self._commanders: defaultdict[str, Commander] = defaultdict(Commander)
        self._refusals = Refusals(self.name, self._say)
        self._said: deque[Sample] = deque()
        self._news = threading.Event()
        self._status_due_ns = 0
        self._outgoing: Outgoing | None = None

    def table(self) -> tuple[Row, ...]:
        """Return the rows of what the parameters ask for."""
        return face(self.params) if self.params.profile == "dvrk" else paper_face(self.params)

    @abstractmethod
    def connect(self, directory: Path) -> Transport:
        """Join the ROS graph.

        Raises MissingExtraError or DeviceError where that cannot be; relative paths start at `directory`.
        """

    @property
    def ports(self) -> tuple[Port, ...]:
        """One per topic that the simulation tells or takes, named like it, and `gateway`, the status."""
        return self._ports

    def open(self, directory: Path) -> None:
        """Join the ROS graph with every row of the table, and begin to publish."""
        self.close()
        self._forget()
        self._transport = transport = self.connect(directory)
        self._outgoing = Outgoing(self.name, self._advertised(transport), self.params.publish_period)
        for port, value in self._early.items():
            self._events[port].write(value)
        self._early = {}
        for row in self.rows:
            if row.way == "subscribe":
                commander = self._commanders[row.owner] if row.leads else None
                transport.subscribe(
                    row, Incoming(row, commander, self._traffic[row], self._hand_on, self._refusals.tell).take
                )
            elif row.way == "serve":
                transport.serve(row, self._handler(row))

    def _advertised(self, transport: Transport) -> list[Periodic]:
        """Advertise all that is published; return what is published all the time."""
        rows = [
            (row, transport.advertise(row), self._traffic[row]) for row in self.rows if row.way == "publish"
        ]
        self._states = {
            row.port.name: State(row.port) for row, _, _ in rows if row.port is not None and row.periodic
        }
        whole: Mapping[str, Source] = (
            scenery(self.params, self._states) if self.params.profile == "dvrk" else {}
        )
        periodic: list[Periodic] = []
        for row, publish, count in rows:
            if row.port is not None and row.periodic:
                periodic.append(Periodic(self._states[row.port.name], publish, count))
            elif row.port is not None:
                self._events[row.port.name] = Event(publish, count)
            elif row.name in whole:
                periodic.append(
                    Periodic(whole[row.name], publish, count, stride(row.name, self.params.publish_period))
                )
            elif self.params.robot_description is not None:
                Event(publish, count).write(StringMessage(data=description(self.params.robot_description)))
        return periodic

    def _hand_on(self, row: Row, message: Message) -> None:
        if row.port is not None:
            self._said.append(Sample(row.port.name, message))
            self._news.set()

    def _handler(self, row: Row) -> Handler:
        """Return what answers a service of an arm."""
        arm, count = self.params.arms.shown[cast("CartArm", row.owner)], self._traffic[row]
        handle = kinematics_handler(row, arm.chain, self._states[f"SUJ/{row.owner}/measured_cp"])

        def counted(payload: bytes) -> bytes:
            count.messages += 1
            return handle(payload)

        return counted

    def read(self, t: int) -> list[Sample]:
        """Return what ROS programs have said since the last time, and the status once a second."""
        if self._outgoing is not None:
            self._outgoing.check()
        self._news.clear()
        said = [self._said.popleft() for _ in range(len(self._said))]
        if self._transport is not None and t >= self._status_due_ns:
            self._status_due_ns = t + _STATUS_NS
            said.append(Sample(self._status.name, self._traffic.status(self._transport.clients())))
        return said

    def wait(self, seconds: float) -> bool:
        """Wait for what ROS programs say, at most so long; return whether they have."""
        return self._news.wait(seconds)

    def write(self, port: str, value: Value) -> None:
        """Take the newest value of a state, or publish a message. Never blocks."""
        row = self._inputs.get(port)
        if row is None:
            raise MessageError(
                f"device '{self.name}' has no input '{port}'.{did_you_mean(port, self._inputs)}"
            )
        if row.name == "operating_state" and isinstance(value, OperatingState):
            self._commanders[row.owner].busy = value.is_busy
        if port in self._states:
            self._states[port].write(cast("Vector", value))
        elif port in self._events:
            self._events[port].write(value)
        elif row.latched:
            self._early[port] = value

    def _say(self, port: str, text: StringMessage) -> None:
        """Publish a word of the gateway itself, where there is a topic for it: the console has warnings only."""
        owner = port.rpartition("/")[0]
        event = self._events.get(port) or self._events.get(f"{owner}/warning")
        if event is not None:
            event.write(text)

    def close(self) -> None:
        """Leave the graph."""
        if self._outgoing is not None:
            self._outgoing.close()
        if self._transport is not None:
            self._transport.close()
        self._outgoing = self._transport = None
        self._states, self._events = {}, {}
