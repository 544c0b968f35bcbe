"""The link of the hub to a host started by the hub: a socket for grants and acks, and a shared number.

The socket is made before the process, and the process inherits an end: without a name no other process can
connect, and no name can be left behind. In the number the host notes which participant it steps: the hub
knows without a message of each. Linux only; other hosts have Zenoh.
"""

from __future__ import annotations

import mmap
import os
import socket
import struct
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from time import sleep

__all__ = ["IDLE", "TIME_LIMIT", "HostLink", "HubLink", "has_link"]

IDLE = -1
"""The shared number of a host stepping no participant."""

_LENGTH = struct.Struct("<I")
_ACK = struct.Struct("<HI")
"""Head of each ack: place of the participant in the step order of the host, and length of the ack."""
_WORD = 8
_CHUNK = 4096
_LOOK_S = 0.02
"""Longest single wait of a process, which may have to look elsewhere."""
TIME_LIMIT = struct.pack("@ll", 0, round(_LOOK_S * 1e6))
"""The same as `struct timeval` of socket(7), for SO_RCVTIMEO and SO_SNDTIMEO."""


def has_link(host: str) -> bool:
    """Return whether the hub starts `host` with a link."""
    return sys.platform == "linux" and host != "hub" and not host.startswith("remote/")


class _Messages:
    """Messages of any length on a stream socket, each with its length in front."""

    def __init__(self, stream: socket.socket) -> None:
        self.stream = stream
        self.ended = False
        """Whether the process at the far end has closed the socket, or has ended."""
        self._arrived = b""

    def send(self, payload: bytes) -> None:
        """Send a message; nothing if the far process has ended: the hub's watchdog reports the end."""
        with suppress(BrokenPipeError, ConnectionResetError):
            self.stream.sendall(_LENGTH.pack(len(payload)) + payload)

    def receive(self, flags: int = 0) -> bytes | None:
        """Return the next message; None if the time limit of the socket is over, or the far end closed."""
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
    """The hub's end of the link to a host.

    Args:
        names: The stepped participants of the host, in step order.
    """

    def __init__(self, names: list[str]) -> None:
        self._names = names
        mine, self._theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_STREAM)
        for end in (mine, self._theirs):
            end.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, TIME_LIMIT)
        self._messages = _Messages(mine)
        self._file = os.memfd_create("trocar-host")
        os.ftruncate(self._file, _WORD)
        self._memory = mmap.mmap(self._file, _WORD)
        self._place = memoryview(self._memory).cast("q")
        self._place[0] = IDLE

    @property
    def inherited(self) -> tuple[int, int]:
        """The descriptors for the host's process to inherit, for `HostLink`."""
        return self._theirs.fileno(), self._file

    def close_inherited(self) -> None:
        """Close the descriptors inherited by the host's process: the socket then ends with the process."""
        self._theirs.close()
        if self._file >= 0:
            os.close(self._file)
        self._file = -1

    @property
    def passed(self) -> Sequence[str]:
        """The participants before the present or last stepped participant in step order."""
        return self._names[: max(self._place[0], 0)]

    def send_grant(self, grant: bytes) -> None:
        """Send a grant."""
        self._messages.send(grant)

    def acks(self, *, wait: bool) -> list[tuple[str, bytes]]:
        """Return participants and acks of the next message; none if no message has arrived.

        With `wait`, wait a moment for a message.
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
        self.close_inherited()


class HostLink:
    """A host's end of the link to the hub.

    Args:
        stream: The descriptor of the socket, inherited from the hub.
        file: The descriptor of the shared number.
        inboxes: Descriptors of the ends of `Inboxes` used by the host, by reading host.
    """

    def __init__(self, stream: int, file: int, inboxes: Mapping[str, int] | None = None) -> None:
        self.inboxes = {host: socket.socket(fileno=end) for host, end in (inboxes or {}).items()}
        self._messages = _Messages(socket.socket(fileno=stream))
        self._memory = mmap.mmap(file, _WORD)
        os.close(file)
        self.place = memoryview(self._memory).cast("q")
        """Place of the participant being stepped, or IDLE; a single element."""

    def grant(self, *, wait: bool) -> bytes | None:
        """Return the next grant; None if no grant has arrived. With `wait`, wait a moment."""
        grant = self._messages.receive(0 if wait else socket.MSG_DONTWAIT)
        if wait and self._messages.ended:
            sleep(_LOOK_S)  # the hub has ended, and so does this process
        return grant

    def send_acks(self, acks: Sequence[tuple[int, bytes]]) -> None:
        """Send acks, each with the place of the participant, in a single message."""
        self._messages.send(b"".join(_ACK.pack(place, len(ack)) + ack for place, ack in acks))

    def close(self) -> None:
        """Close the link; for the hub this is the end of the process."""
        self._messages.stream.close()
        self.place.release()
        self._memory.close()
