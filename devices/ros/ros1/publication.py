"""A topic that a node of ROS 1 publishes, and the programs that listen to it."""

from __future__ import annotations

import threading

from devices.ros.ros1.connection import Connection, Fields, Incoming, header_frame
from devices.ros.ros1.types import Wire, checksum, definition, ros1_name
from devices.ros.topics.row import Row
from schemas.errors import MessageError

__all__ = ["Publication"]

_STATES_KEPT = 2
"""States and pictures that wait for a slow reader, beside what the system's buffers hold."""
_EVENTS_KEPT = 1000
_CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
"""Comes with each picture."""


class Publication:
    """Sends each message to all that listen, and the last one of a latched topic to whoever comes."""

    def __init__(self, row: Row, node: str) -> None:
        """Take the topic, and the name of our node."""
        self.topic, self.type = row.topic, ros1_name(row.type)
        self._wire, self._latched = Wire(row.type), row.latched
        self._header = {
            "callerid": node,
            "latching": "1" if row.latched else "0",
            "md5sum": checksum(row.type),
            "message_definition": definition(row.type),
            "topic": self.topic,
            "type": self.type,
        }
        self._keep = (
            _STATES_KEPT if row.periodic or row.is_picture or row.type == _CAMERA_INFO else _EVENTS_KEPT
        )
        self._readers: list[Connection] = []
        self._last: bytearray | None = None
        self._count = 0
        self._publishing = threading.Lock()

    def publish(self, message: bytes) -> None:
        """Send a message (CDR); whoever does not keep up gets what is newest."""
        if not self._readers and not self._latched:
            return
        with self._publishing:
            self._count += 1
            frame = self._wire.frame(message, self._count)
            self._last = frame if self._latched else None
            for reader in self._readers:
                reader.send(frame)

    def greet(self, reader: Connection, fields: Fields) -> Incoming:
        """Take a program that wants to listen. Raises MessageError if it takes the topic for something else."""
        ours, theirs = self._header["md5sum"], fields.get("md5sum", "*")
        if theirs not in (ours, "*"):
            what = f"{self.topic} is {self.type} with MD5 {ours}, not {fields.get('type', '?')} with {theirs}"
            raise MessageError(f"{what}: its messages are of another version")
        reader.keep = self._keep
        with self._publishing:
            reader.send(header_frame(self._header))
            if self._last is not None:
                reader.send(self._last)
            self._readers = [*self._readers, reader]
        return lambda _: None  # a reader says nothing more

    def part(self, reader: Connection) -> None:
        """Send no more to a program that has gone."""
        with self._publishing:
            self._readers = [other for other in self._readers if other is not reader]
