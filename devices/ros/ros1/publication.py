"""A topic published by our ROS 1 node, and the subscribers."""

from __future__ import annotations

import threading

from devices.ros.ros1.connection import Connection, Fields, FrameHandler, header_frame
from devices.ros.ros1.types import Wire, checksum, definition, ros1_name
from devices.ros.topics.row import Row
from schemas.errors import MessageError
from schemas.ros import CameraInfo

__all__ = ["Publication"]

_STATES_KEPT = 2
"""Number of states and pictures queued for a slow subscriber, beside the system's buffers."""
_EVENTS_KEPT = 1000


class Publication:
    """Sends each message to all subscribers, and a latched topic's last message to new subscribers."""

    def __init__(self, row: Row, node: str) -> None:
        """`node`: name of our node."""
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
            _STATES_KEPT
            if row.periodic or row.is_picture or row.type == CameraInfo.ros_type
            else _EVENTS_KEPT
        )
        self._subscribers: list[Connection] = []
        self._last: bytearray | None = None
        self._count = 0
        self._publishing = threading.Lock()

    @property
    def wanted(self) -> bool:
        """Whether a program subscribes, or gets the last message later."""
        return self._latched or bool(self._subscribers)

    def __call__(self, message: bytes, /) -> None:
        """Send a message (CDR); a slow subscriber gets the newest messages."""
        with self._publishing:  # also around the look: a subscriber that has our header gets what follows
            if not self.wanted:
                return
            self._count += 1
            frame = self._wire.frame(message, self._count)
            self._last = frame if self._latched else None
            for subscriber in self._subscribers:
                subscriber.send(frame)

    def on_header(self, subscriber: Connection, fields: Fields) -> FrameHandler:
        """Add a subscriber. Raises MessageError for a header with another type."""
        ours, theirs = self._header["md5sum"], fields.get("md5sum", "*")
        if theirs not in (ours, "*"):
            what = f"{self.topic} is {self.type} with MD5 {ours}, not {fields.get('type', '?')} with {theirs}"
            raise MessageError(f"{what}: the subscriber has another version of the message")
        subscriber.keep = self._keep
        with self._publishing:
            subscriber.send(header_frame(self._header))
            if self._last is not None:
                subscriber.send(self._last)
            self._subscribers = [*self._subscribers, subscriber]
        return lambda _: None  # a subscriber sends nothing after its header

    def remove(self, subscriber: Connection) -> None:
        """Remove a subscriber after the end of the connection."""
        with self._publishing:
            self._subscribers = [other for other in self._subscribers if other is not subscriber]
