"""A socket that shows pictures to any number of GStreamer's `unixfdsrc`. Nothing waits for a reader.

A picture is in shared memory; a reader gets a descriptor and says when it is done. A reader that holds
several pictures gets no other one until it has released one.
"""

from __future__ import annotations

import errno
import logging
import socket
import threading
from array import array
from dataclasses import dataclass, field
from itertools import count
from time import monotonic_ns

from devices.dvrk_video.messages import END_OF_STREAM, buffer_message, caps_message, released_buffers
from devices.dvrk_video.shared_memory import PictureMemory
from schemas.errors import DeviceError, MessageError

__all__ = ["SocketSink"]

log = logging.getLogger(__name__)

_MOST_HELD = 8
"""Pictures that a reader may hold: queues of the dVRK's programs have two or three."""
_MOST_READERS = 16
_RECEIVED = 4096


@dataclass
class _Reader:
    """A connected reader."""

    socket: socket.socket
    held: dict[int, PictureMemory] = field(default_factory=dict[int, PictureMemory])
    """Memories by the number of the picture."""
    received: bytearray = field(default_factory=bytearray)
    caps: str = ""
    """The format stated last."""
    sent: int = 0
    dropped: int = 0


class SocketSink:
    """A socket `@name` in Linux's abstract namespace."""

    def __init__(self, name: str) -> None:
        """Listen at `name`, which begins with `@`. Raises DeviceError if another program does."""
        self.name = name
        self._lock = threading.Lock()
        self._readers: list[_Reader] = []
        self._memories: list[PictureMemory] = []
        self._numbers = count(1)
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK)
        try:
            self._listener.bind("\0" + name.removeprefix("@"))
            self._listener.listen()
        except OSError as error:
            self._listener.close()
            taken = ": another program shows pictures there" if error.errno == errno.EADDRINUSE else ""
            raise DeviceError(f"cannot listen at '{name}': {error.strerror}{taken}") from error

    def serve(self) -> bool:
        """Welcome new readers, take back pictures; return whether anybody reads."""
        with self._lock:
            self._serve()
            return bool(self._readers)

    def send(self, content: bytes, caps: str, metadata: bytes) -> None:
        """Show a picture with its format and metadata to all readers that have room for it."""
        with self._lock:
            self._serve()
            ready = [reader for reader in self._readers if self._has_room(reader)]
            if not ready:
                return
            memory, number = self._free_memory(len(content)), next(self._numbers)
            memory.fill(content)
            message = buffer_message(number, monotonic_ns(), memory.size, metadata)
            for reader in ready:
                if reader.caps != caps and not self._put(reader, caps_message(caps)):
                    continue
                reader.caps = caps
                if self._put(reader, message, memory):
                    reader.held[number] = memory
                    reader.sent += 1
                    memory.holders += 1

    def close(self) -> None:
        """Say goodbye to the readers."""
        with self._lock:
            for reader in list(self._readers):
                if self._put(reader, END_OF_STREAM):
                    self._leave(reader, "the session has ended")
            self._listener.close()
            for memory in self._memories:
                memory.close()
            self._memories = []

    def _serve(self) -> None:
        while True:
            try:
                connected, _ = self._listener.accept()
            except (BlockingIOError, ConnectionAbortedError):
                break
            if len(self._readers) == _MOST_READERS:
                log.warning("'%s': more than %d readers are refused", self.name, _MOST_READERS)
                connected.close()
                continue
            connected.setblocking(False)
            self._readers.append(_Reader(connected))
            log.info("'%s': a reader has come, there are %d", self.name, len(self._readers))
        for reader in list(self._readers):
            self._take_back(reader)

    def _take_back(self, reader: _Reader) -> None:
        try:
            while piece := reader.socket.recv(_RECEIVED):
                reader.received += piece
                for number in released_buffers(reader.received):
                    memory = reader.held.pop(number, None)
                    if memory is None:
                        raise MessageError(f"picture {number} is released, which it does not hold")
                    memory.holders -= 1
            self._leave(reader, "it has gone")
        except BlockingIOError:
            return
        except ConnectionResetError:
            self._leave(reader, "it has gone")
        except (OSError, MessageError) as error:
            self._leave(reader, str(error))

    def _has_room(self, reader: _Reader) -> bool:
        has_room = len(reader.held) < _MOST_HELD
        reader.dropped += not has_room
        return has_room

    def _free_memory(self, size: int) -> PictureMemory:
        """Return a memory without holders; memories of other sizes are closed."""
        for memory in [one for one in self._memories if not one.holders and one.size != size]:
            self._memories.remove(memory)
            memory.close()
        free = next((one for one in self._memories if not one.holders), None)
        if free is None:
            free = PictureMemory(size)
            self._memories.append(free)
        return free

    def _put(self, reader: _Reader, message: bytes, memory: PictureMemory | None = None) -> bool:
        """Send a message whole and at once; return whether it was sent. A reader whose queue is full goes."""
        beside = [] if memory is None else [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array("i", [memory.fd]))]
        try:
            sent = reader.socket.sendmsg([message], beside, socket.MSG_DONTWAIT | socket.MSG_NOSIGNAL)
        except OSError as error:
            self._leave(reader, str(error))
            return False
        if sent != len(message):
            self._leave(reader, "it does not read")
        return sent == len(message)

    def _leave(self, reader: _Reader, reason: str) -> None:
        self._readers.remove(reader)
        reader.socket.close()
        for memory in reader.held.values():
            memory.holders -= 1
        log.info(
            "'%s': a reader is left: %s; %d pictures sent, %d dropped while it held others",
            self.name,
            reason,
            reader.sent,
            reader.dropped,
        )
