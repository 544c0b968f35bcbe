"""One connection between two programs of ROS 1 (TCPROS): a header each, and then frames of four bytes of
length and a message.

Source: wiki.ros.org/ROS/TCPROS and wiki.ros.org/ROS/Connection Header.
"""

from __future__ import annotations

import logging
import socket
import struct
import threading
from collections import deque
from collections.abc import Callable, Mapping
from functools import partial

from devices.ros.ros1.loop import Loop
from schemas.codec import MAX_MESSAGE_BYTES
from schemas.errors import MessageError

__all__ = ["Connection", "Fields", "Incoming", "header_frame"]

log = logging.getLogger(__name__)

Fields = Mapping[str, str]
"""What a connection's header tells: topic, type, md5sum, callerid and more."""

Incoming = Callable[[bytes], None]
"""Takes a message, without its length."""

_LENGTH = struct.Struct("<I")
_READ_BYTES = 1 << 14
"""At once, of one connection: a flood on it has the others wait for so much."""
_MOST_HEADER_BYTES = 1 << 20
_BACKLOG = 1000
_KEEPALIVE = {"TCP_KEEPIDLE": 60, "TCP_KEEPINTVL": 10, "TCP_KEEPCNT": 9}
"""Seconds of silence until it is asked whether the other machine is still there, between two questions, and
how many of them; where the system lets them be set. As rospy has it (ros/ros_comm,
clients/rospy/src/rospy/impl/tcpros_base.py): one that lost its power closes no connection.
"""


def header_frame(fields: Fields) -> bytes:
    """Return a header as it is sent."""
    parts = [f"{name}={value}".encode() for name, value in fields.items()]
    content = b"".join(_LENGTH.pack(len(part)) + part for part in parts)
    return _LENGTH.pack(len(content)) + content


def _fields(content: bytes) -> Fields:
    """Return what a header tells. Raises MessageError if it is none."""
    fields: dict[str, str] = {}
    at = 0
    try:
        while at < len(content):
            (length,) = _LENGTH.unpack_from(content, at)
            name, equals, value = content[at + 4 : at + 4 + length].decode().partition("=")
            at += 4 + length
            if not equals or at > len(content):
                raise ValueError(f"field '{name}' has no value or no end")
            fields[name] = value
    except (struct.error, ValueError) as error:
        raise MessageError(f"{len(content)} bytes are no header of ROS 1 ({error})") from error
    return fields


class Connection:
    """A socket with what is read from and written to it.

    Nothing waits: what a program does not take is kept for it up to a limit, then the oldest is dropped.

    The other side's header goes to `greeted`, which returns what takes the messages that follow; it raises
    MessageError to hang up.
    """

    def __init__(
        self,
        loop: Loop,
        sock: socket.socket,
        greeted: Callable[[Connection, Fields], Incoming],
        lost: Callable[[Connection], None],
        *,
        keep: int = _BACKLOG,
    ) -> None:
        """Take a connected socket, and what is told when the connection has ended; `keep`: messages that wait
        for a slow reader.
        """
        self._loop, self._socket, self._greeted, self._lost, self.keep = loop, sock, greeted, lost, keep
        sock.setblocking(False)
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for name, value in _KEEPALIVE.items():
            if hasattr(socket, name):
                sock.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)
        self.address = str(sock.getpeername()[0])
        self.program = self.address
        """Name of the program at the other side, once its header has come."""
        self._take: Incoming | None = None
        self._read = bytearray()
        self._waiting: deque[memoryview] = deque()
        self._begun = False
        """Whether a part of the first of those that wait is sent."""
        self._writing = threading.Lock()
        self._closed = False

    @property
    def is_greeted(self) -> bool:
        """Whether the other side's header has come, and is heeded."""
        return self._take is not None

    def start(self) -> None:
        """Begin to read; from any thread, once."""
        self._loop.call(partial(self._watch, writing=False))

    def _watch(self, *, writing: bool) -> None:
        if not self._closed:
            self._loop.watch(self._socket, self, writing=writing)

    def send(self, frame: bytes | bytearray) -> None:
        """Send, or keep until there is room; from any thread."""
        with self._writing:
            if self._closed:
                return
            if self._waiting:
                self._keep(memoryview(frame))
                return
            try:
                sent = self._socket.send(frame)
            except BlockingIOError:
                sent = 0
            except OSError:  # reset: the loop sees it, too, and ends the connection
                return
            if sent < len(frame):
                self._waiting.append(memoryview(frame)[sent:])
                self._begun = sent > 0
                self._loop.call(partial(self._watch, writing=True))

    def _keep(self, frame: memoryview) -> None:
        if len(self._waiting) > self.keep:
            del self._waiting[1 if self._begun else 0]
        self._waiting.append(frame)

    def writable(self) -> None:
        """Send what waits."""
        with self._writing:
            try:
                while self._waiting:
                    sent = self._socket.send(self._waiting[0])
                    if sent < len(self._waiting[0]):
                        self._waiting[0] = self._waiting[0][sent:]
                        self._begun = True
                        return
                    self._waiting.popleft()
                    self._begun = False
            except BlockingIOError:
                return
            except OSError:
                self._waiting.clear()
        self._watch(writing=False)

    def readable(self) -> None:
        """Take what has come."""
        try:
            chunk = self._socket.recv(_READ_BYTES)
        except BlockingIOError:
            return
        except OSError:
            chunk = b""
        if not chunk:
            self.close()
            return
        self._read += chunk
        try:
            self._take_frames()
        except MessageError as error:
            log.warning("ROS 1: the connection with %s is closed: %s", self.program, error)
            self.close()
        except Exception:  # what was read is not taken again and again
            self.close()
            raise

    def _take_frames(self) -> None:
        at = 0
        while len(self._read) - at >= _LENGTH.size:
            (length,) = _LENGTH.unpack_from(self._read, at)
            most = MAX_MESSAGE_BYTES if self._take is not None else _MOST_HEADER_BYTES
            if length > most:
                raise MessageError(f"{length} bytes in one message exceed the limit of {most}")
            end = at + _LENGTH.size + length
            if len(self._read) < end:
                break
            content, at = bytes(self._read[at + _LENGTH.size : end]), end
            if self._take is None:
                fields = _fields(content)
                self.program = fields.get("callerid", self.address)
                self._take = self._greeted(self, fields)
            else:
                self._take(content)
        del self._read[:at]

    def close(self) -> None:
        """End the connection; in the loop's thread."""
        with self._writing:
            if self._closed:
                return
            self._closed = True
            self._waiting.clear()
            self._loop.forget(self._socket)
            self._socket.close()
        self._lost(self)
