"""A gateway to ROS, whatever the middleware: the base of the kinds `ros2-zenoh`, `ros2-dds` and `ros1`.

It makes publishers, subscribers, services and ports from one table (`devices.ros.face`), and knows no physics. A gateway for another middleware is
a `connect` that returns another transport.
"""

from __future__ import annotations

import logging
import threading
from abc import abstractmethod
from collections import deque
from collections.abc import Callable
from pathlib import Path
from time import monotonic_ns

from devices.ros.commander import Commander
from devices.ros.face import face
from devices.ros.incoming import Incoming
from devices.ros.kinematics import kinematics_handler
from devices.ros.outgoing import Event, State
from devices.ros.params import GatewayParams
from devices.ros.refusals import Refusals
from devices.ros.row import Row
from devices.ros.scenery import JointStates, Transforms
from devices.ros.traffic import Traffic
from devices.ros.transport import Transport
from hub.participant import Device, Sample, Value
from schemas.crtk import OperatingState
from schemas.errors import MessageError
from schemas.ports import Port
from schemas.ros import StringMessage
from schemas.trocar_msgs import GatewayStatus
from schemas.vectors import Vector

__all__ = ["Gateway"]

log = logging.getLogger(__name__)

_STATUS_NS = 1_000_000_000


class Gateway(Device):
    """Shows the simulation to ROS programs, and brings what they command into it."""

    params_model = GatewayParams
    params: GatewayParams

    def __init__(self, name: str, params: GatewayParams) -> None:
        """Take the participant's name and its parameters."""
        super().__init__(name, params)
        self.rows = self.table()
        """All topics and services."""
        told = "once a second: who is connected, and what goes through"
        self._status = Port(name="gateway", causality="output", type=GatewayStatus.ros_type, variability="event", clock="wall", description=told)
        self._ports = (*(row.port for row in self.rows if row.port is not None), self._status)
        self._transport: Transport | None = None
        self._commands: deque[Sample] = deque()
        self._states: dict[str, State] = {}
        self._events: dict[str, Event] = {}
        self._early: dict[str, Value] = {}
        """The last value of each latched event that came before the gateway was open."""
        self._ending = threading.Event()
        self._publisher = threading.Thread()

    def table(self) -> tuple[Row, ...]:
        """Return the rows; another profile than the dVRK's returns others."""
        return face(self.params)

    @abstractmethod
    def connect(self, directory: Path) -> Transport:
        """Join the ROS graph. Raises MissingExtraError or DeviceError where that cannot be; relative paths start at `directory`."""

    @property
    def ports(self) -> tuple[Port, ...]:
        """One per topic that the simulation tells or takes, named like it, and `gateway`, the status."""
        return self._ports

    def open(self, directory: Path) -> None:
        """Join the ROS graph with every row of the table, and begin to publish."""
        ...

    def read(self, t: int) -> list[Sample]:
        """Return what ROS programs have said since the last time, and the status once a second."""
        ...

    def write(self, port: str, value: Value) -> None:
        """Take the newest value of a state, or publish a message. Never blocks."""
        ...

    def close(self) -> None:
        """Leave the graph."""
        ...
