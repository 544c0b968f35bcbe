"""The fast lane: vectors from one host to another on the same machine, past Zenoh.

A Zenoh hop wakes three threads, a socket one; between processes that wait for each other at every millisecond
this is half of the step (docs/decisions/0006-fast-lane.md). The values are the same, under the same tags;
other subscribers still receive them from Zenoh. Linux only, between processes of one user.
"""

from __future__ import annotations

import hashlib
import os
import socket
import struct
from contextlib import suppress
from time import perf_counter_ns, sleep
from typing import Any

import numpy as np

from hub.transport.cells import INITIAL
from schemas.errors import MessageError
from schemas.ports import Port
from schemas.vectors import Vector, VectorCodec, has_vector

__all__ = ["LaneReceiver", "LaneSender", "has_lane", "lane_address", "may_spin"]

_HEAD = struct.Struct("<q")
_CREDENTIALS = struct.Struct("3i")
_MOST_BYTES = 64 * 2**10
"""A packet must fit into a socket's buffer several times."""

_SPIN_NS = 2_000_000
"""Longer than a neighbour's step takes where steps are short enough for waking up to matter."""


def may_spin(hosts: int) -> bool:
    """Return whether a host may keep its core busy while it waits.

    It may if each of `hosts` processes has a core of its own.
    """
    return hasattr(os, "sched_getaffinity") and hosts <= len(os.sched_getaffinity(0))


def has_lane(port: Port, one_host: str, other_host: str) -> bool:
    """Return whether the values of `port` can go from one host to the other without Zenoh."""
    if (
        not hasattr(socket, "SO_PEERCRED")
        or one_host.startswith("remote/")
        or other_host.startswith("remote/")
    ):
        return False
    return (
        has_vector(port.type) and port.variability == "signal" and 8 * VectorCodec(port).size <= _MOST_BYTES
    )


def lane_address(run: int, participant: str, port: str, reader_host: str) -> str:
    """Return the address of a lane, in Linux' abstract namespace: it leaves no file behind."""
    name = f"{run:x} {participant} {port} {reader_host}"
    return f"\0trocar-{hashlib.blake2b(name.encode(), digest_size=16).hexdigest()}"


def _is_ours(connection: socket.socket) -> bool:
    """Return whether the process at the other end belongs to the same user.

    Names in the abstract namespace are open to all.
    """
    _, user, _ = _CREDENTIALS.unpack(
        connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
    )
    return user == os.getuid()


class LaneSender:
    """The writing end.

    It connects while values at time 0 are repeated; before that there is no reader.
    """

    def __init__(self, address: str) -> None:
        self._address = address
        self._socket: socket.socket | None = None

    def send(self, step: int, value: Vector) -> None:
        """Send the value computed in `step`."""
        if self._socket is None and not (step == INITIAL and self._connect()):
            return
        # the reader is gone; the hub, which watches processes, reports why
        with suppress(BrokenPipeError, ConnectionResetError):
            self._socket.send(_HEAD.pack(step) + value.tobytes())  # pyright: ignore[reportOptionalMemberAccess]

    def _connect(self) -> bool:
        connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        try:
            connection.connect(self._address)
        except ConnectionRefusedError:  # the reader does not listen yet
            connection.close()
            return False
        if not _is_ours(connection):
            connection.close()
            return False
        self._socket = connection
        return True

    def close(self) -> None:
        """Close the connection."""
        if self._socket is not None:
            self._socket.close()


class LaneReceiver:
    """The reading end; it listens from the start.

    With `spin` it polls for a while before it sleeps.
    """

    def __init__(self, address: str, port: Port, *, spin: bool) -> None:
        self._spin_ns = _SPIN_NS if spin else 0
        self._codec = VectorCodec(port)
        self._connection: socket.socket | None = None
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._listener.bind(address)
        self._listener.listen(1)
        self._listener.setblocking(False)
        self._length = _HEAD.size + 8 * self._codec.size

    def poll(self) -> tuple[int, Any] | None:
        """Return the next value if one has arrived."""
        if self._connection is None and not self._accept():
            return None
        try:
            return self._parse(self._connection.recv(self._length + 1, socket.MSG_DONTWAIT))  # pyright: ignore[reportOptionalMemberAccess]
        except BlockingIOError:
            return None

    def receive(self) -> tuple[int, Any]:
        """Wait for the next value and return it with its tag's step."""
        if self._connection is None:
            raise MessageError(f"port '{self._codec.port.name}': no sender has connected to this lane yet")
        until_ns = perf_counter_ns() + self._spin_ns
        while perf_counter_ns() < until_ns:
            with suppress(BlockingIOError):
                return self._parse(self._connection.recv(self._length + 1, socket.MSG_DONTWAIT))
        return self._parse(self._connection.recv(self._length + 1))

    def _accept(self) -> bool:
        try:
            connection, _ = self._listener.accept()
        except BlockingIOError:
            return False
        if not _is_ours(connection):
            connection.close()
            return False
        connection.setblocking(True)
        self._connection = connection
        return True

    def _parse(self, packet: bytes) -> tuple[int, Vector]:
        while not packet:
            sleep(1.0)  # the sender is gone: the hub reports it and interrupts this thread
        if len(packet) != self._length:
            raise MessageError(
                f"port '{self._codec.port.name}': a packet of {len(packet)} bytes, expected {self._length}"
            )
        return _HEAD.unpack_from(packet)[0], self._codec.checked(
            np.frombuffer(packet, np.float64, offset=_HEAD.size)
        )

    def close(self) -> None:
        """Close both sockets."""
        self._listener.close()
        if self._connection is not None:
            self._connection.close()
