"""A TCPROS connection: a header from each side, then frames of four bytes of length and a message.

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

from devices.ros.ros1.event_loop import EventLoop
from schemas.codec import MAX_MESSAGE_BYTES
from schemas.errors import MessageError

__all__ = ["Connection", "Fields", "FrameHandler", "header_frame", "parse_header"]

log = logging.getLogger(__name__)

Fields = Mapping[str, str]
"""The fields of a connection header: topic, type, md5sum, callerid and more."""

FrameHandler = Callable[[bytes], None]
"""Receives the message of a frame, without the length."""

_LENGTH = struct.Struct("<I")
_READ_BYTES = 1 << 14
"""Bytes read at once from one connection, a bound on the wait of the others."""
_MOST_HEADER_BYTES = 1 << 20
_BACKLOG = 1000
_KEEPALIVE = {"TCP_KEEPIDLE": 60, "TCP_KEEPINTVL": 10, "TCP_KEEPCNT": 9}
"""Seconds of silence until the first probe, seconds between probes, and number of probes, where the system
has these options. As in rospy (ros/ros_comm, clients/rospy/src/rospy/impl/tcpros_base.py): after a power
failure a machine closes no connection.
"""


def header_frame(fields: Fields) -> bytes:
    """Return the frame of a connection header."""
    parts = [f"{name}={value}".encode() for name, value in fields.items()]
    content = b"".join(_LENGTH.pack(len(part)) + part for part in parts)
    return _LENGTH.pack(len(content)) + content


def parse_header(content: bytes) -> Fields:
    """Return the fields of a connection header. Raises MessageError for an invalid header."""
    fields: dict[str, str] = {}
    at = 0
    try:
        while at < len(content):
            (length,) = _LENGTH.unpack_from(content, at)
            name, equals, value = content[at + 4 : at + 4 + length].decode().partition("=")
            at += 4 + length
            if not equals or at > len(content):
                raise ValueError(f"field '{name[:40]}' has no value or no end")
            fields[name] = value
    except (struct.error, ValueError) as error:
        raise MessageError(f"{len(content)} bytes are no header of ROS 1 ({error})") from error
    return fields


class Connection:
    """A socket of the event loop, with buffers.

    Sending never blocks: unread messages are kept up to a limit, then the oldest is dropped.
    """

    def __init__(
        self,
        loop: EventLoop,
        sock: socket.socket,
        on_header: Callable[[Connection, Fields], FrameHandler],
        on_closed: Callable[[Connection], None],
        *,
        keep: int = _BACKLOG,
    ) -> None:
        """Prepare a connected socket; `start` begins to read.

        Args:
            loop: event loop of the reading and writing thread.
            sock: the connected socket.
            on_header: gets the far side's header and returns the handler of the following messages; raises
                MessageError to close the connection.
            on_closed: called when the connection has ended.
            keep: number of messages kept for a slow reader.
        """
        self._loop, self._socket, self.keep = loop, sock, keep
        self._on_header, self._on_closed = on_header, on_closed
        sock.setblocking(False)
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for name, value in _KEEPALIVE.items():
            if hasattr(socket, name):
                sock.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)
        self.address = str(sock.getpeername()[0])
        self.program = self.address
        """Name of the program at the far side, from the header on."""
        self._on_frame: FrameHandler | None = None
        self._read = bytearray()
        self._queue: deque[memoryview] = deque()
        self._partly_sent = False
        """Whether the first frame of the queue is sent in part."""
        self._writing = threading.Lock()
        self._closed = False

    @property
    def is_established(self) -> bool:
        """Whether the far side's header has been accepted."""
        return self._on_frame is not None

    def start(self) -> None:
        """Start to read; from any thread, once."""
        self._loop.call(partial(self._watch, writing=False))

    def _watch(self, *, writing: bool) -> None:
        if not self._closed:
            self._loop.watch(self._socket, self, writing=writing)

    def send(self, frame: bytes | bytearray) -> None:
        """Send a frame, or queue the frame until the socket is writable; from any thread."""
        with self._writing:
            if self._closed:
                return
            if self._queue:
                self._enqueue_frame(memoryview(frame))
                return
            try:
                sent = self._socket.send(frame)
            except BlockingIOError:
                sent = 0
            except OSError:  # reset: the loop notices it, too, and ends the connection
                return
            if sent < len(frame):
                self._queue.append(memoryview(frame)[sent:])
                self._partly_sent = sent > 0
                self._loop.call(partial(self._watch, writing=True))

    def _enqueue_frame(self, frame: memoryview) -> None:
        if len(self._queue) > self.keep:
            del self._queue[1 if self._partly_sent else 0]
        self._queue.append(frame)

    def writable(self) -> None:
        """Send queued frames."""
        with self._writing:
            try:
                while self._queue:
                    sent = self._socket.send(self._queue[0])
                    if sent < len(self._queue[0]):
                        self._queue[0] = self._queue[0][sent:]
                        self._partly_sent = True
                        return
                    self._queue.popleft()
                    self._partly_sent = False
            except BlockingIOError:
                return
            except OSError:
                self._queue.clear()
        self._watch(writing=False)

    def readable(self) -> None:
        """Read arrived bytes, and handle complete frames."""
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
            self._handle_frames()
        except MessageError as error:
            log.warning("ROS 1: the connection with %s is closed: %s", self.program, error)
            self.close()
        except Exception:  # the same bytes must not be handled again and again
            self.close()
            raise

    def _handle_frames(self) -> None:
        at = 0
        while len(self._read) - at >= _LENGTH.size:
            (length,) = _LENGTH.unpack_from(self._read, at)
            most = MAX_MESSAGE_BYTES if self._on_frame is not None else _MOST_HEADER_BYTES
            if length > most:
                raise MessageError(f"{length} bytes in one message exceed the limit of {most}")
            end = at + _LENGTH.size + length
            if len(self._read) < end:
                break
            content, at = bytes(self._read[at + _LENGTH.size : end]), end
            if self._on_frame is None:
                fields = parse_header(content)
                self.program = fields.get("callerid", self.address)
                self._on_frame = self._on_header(self, fields)
            else:
                self._on_frame(content)
        del self._read[:at]

    def close(self) -> None:
        """End the connection; in the loop's thread."""
        with self._writing:
            if self._closed:
                return
            self._closed = True
            self._queue.clear()
            self._loop.forget(self._socket)
            self._socket.close()
        self._on_closed(self)
