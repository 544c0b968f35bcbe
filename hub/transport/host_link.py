"""The link of the hub to a host that it has started: a socket for grants and acks, and a shared number.

The socket is made before the process, which inherits its end: it has no name under which another process
could connect, and none that could be left behind. In the number the host notes which participant it steps:
the hub knows it without a message of each. Linux only; other hosts have Zenoh.
"""

from __future__ import annotations

import mmap
import os
import socket
import struct
import sys
from collections.abc import Sequence
from contextlib import suppress
from time import sleep

__all__ = ["IDLE", "HostLink", "HubLink", "has_link"]

IDLE = -1
"""The shared number of a host that steps no participant."""

_LENGTH = struct.Struct("<I")
_ACK = struct.Struct("<HI")
"""In front of each ack: the place of its participant in the step order of the host, and its length."""
_WORD = 8
_CHUNK = 4096
_LOOK_S = 0.02
"""The hub waits no longer at once: it may have to look elsewhere."""
_TIME_LIMIT = struct.pack("@ll", 0, round(_LOOK_S * 1e6))
"""`struct timeval` of socket(7), SO_RCVTIMEO."""


def has_link(host: str) -> bool:
    """Return whether the hub starts `host` with a link."""
    return sys.platform == "linux" and host != "hub" and not host.startswith("remote/")


class _Messages:
    """Messages of any length on a stream socket, each with its length in front."""

    def __init__(self, stream: socket.socket) -> None:
        self.stream = stream
        self.ended = False
        """Whether the other process has closed its end, or has ended."""
        self._arrived = b""

    def send(self, payload: bytes) -> None:
        """Send a message; nothing if the other process has ended, which the hub's watchdog reports."""
        with suppress(BrokenPipeError, ConnectionResetError):
            self.stream.sendall(_LENGTH.pack(len(payload)) + payload)

    def receive(self, flags: int = 0) -> bytes | None:
        """Return the next message; None if the time limit of the socket is over, or the other end closed."""
        while True:
            arrived, end = self._arrived, _LENGTH.size
            if len(arrived) >= end:
                end += _LENGTH.unpack_from(arrived)[0]
                if len(arrived) >= end:
                    self._arrived = arrived[end:]
                    return arrived[_LENGTH.size : end]
            try:
                more = self.stream.recv(max(end - len(arrived), _CHUNK), flags)
            except BlockingIOError:
                return None
            except ConnectionResetError:
                more = b""
            if not more:
                self.ended = True
                return None
            self._arrived = arrived + more


class HubLink:
    """The hub's end of the link to one host.

    Args:
        names: The stepped participants of the host, in step order.
    """

    def __init__(self, names: list[str]) -> None:
        self._names = names
        mine, self._theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_STREAM)
        mine.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, _TIME_LIMIT)
        self._messages = _Messages(mine)
        self._file = os.memfd_create("trocar-host")
        os.ftruncate(self._file, _WORD)
        self._memory = mmap.mmap(self._file, _WORD)
        self._place = memoryview(self._memory).cast("q")
        self._place[0] = IDLE

    @property
    def inherited(self) -> tuple[int, int]:
        """The descriptors that the host's process inherits, for `HostLink`."""
        return self._theirs.fileno(), self._file

    def started(self) -> None:
        """Close what the host's process has inherited, so that its end is the end of the socket."""
        self._theirs.close()
        if self._file >= 0:
            os.close(self._file)
        self._file = -1

    @property
    def passed(self) -> Sequence[str]:
        """The participants that stand in step order before the one that the host steps now, or did last."""
        return self._names[: max(self._place[0], 0)]

    def send_grant(self, grant: bytes) -> None:
        """Send a grant."""
        self._messages.send(grant)

    def acks(self, *, wait: bool) -> list[tuple[str, bytes]]:
        """Return participants and acks of the next message; none if it has not arrived.

        With `wait`, wait for it a moment.
        """
        message = self._messages.receive(0 if wait else socket.MSG_DONTWAIT)
        if message is None:
            if wait and self._messages.ended:
                sleep(_LOOK_S)  # until the watchdog reports how the process has ended
            return []
        acks, start = list[tuple[str, bytes]](), 0
        while start < len(message):
            head: tuple[int, int] = _ACK.unpack_from(message, start)
            place, length = head
            start += _ACK.size
            acks.append((self._names[place], message[start : start + length]))
            start += length
        return acks

    def close(self) -> None:
        """Close the link."""
        self._messages.stream.close()
        self._place.release()
        self._memory.close()
        self.started()


class HostLink:
    """A host's end of its link to the hub.

    Args:
        stream: The descriptor of the socket, inherited from the hub.
        file: The descriptor of the shared number.
    """

    def __init__(self, stream: int, file: int) -> None:
        self._messages = _Messages(socket.socket(fileno=stream))
        self._memory = mmap.mmap(file, _WORD)
        os.close(file)
        self.place = memoryview(self._memory).cast("q")
        """Of one element: the place of the participant that the host steps, or IDLE."""

    def grant(self, *, wait: bool) -> bytes | None:
        """Return the next grant; None if it has not arrived. With `wait`, wait for it."""
        grant = self._messages.receive(0 if wait else socket.MSG_DONTWAIT)
        while wait and grant is None:
            sleep(1.0)  # the hub has ended, and so does this process
        return grant

    def send_acks(self, acks: Sequence[tuple[int, bytes]]) -> None:
        """Send acks, each with the place of its participant, in one message."""
        self._messages.send(b"".join(_ACK.pack(place, len(ack)) + ack for place, ack in acks))

    def close(self) -> None:
        """Close the link; the hub takes it for the end of this process."""
        self._messages.stream.close()
        self.place.release()
        self._memory.close()
