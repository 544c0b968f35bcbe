"""Certificates for tests: those of a hub and its participants, and those that a stranger may come with."""

import os
import socket
from collections.abc import Iterator
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import NamedTuple

from hub.security import certs
from hub.security.credentials import Credentials, load


class Authority(NamedTuple):
    """An authority in a directory of its own, with the hub's certificate for this machine."""

    directory: Path

    @classmethod
    def founded(cls, directory: Path, *hosts: str) -> "Authority":
        certs.create_authority(directory, hosts or ("127.0.0.1", "localhost"), 1)
        return cls(directory)

    def issued(self, name: str, days: float = 1) -> Credentials:
        return load(name, certs.issue(self.directory, name, days))

    def renewed(self, days: float) -> Credentials:
        return load("hub", certs.renew(self.directory, (), days))

    @property
    def hub(self) -> Credentials:
        return load("hub", self.directory)


def free_port() -> int:
    """Return a port for what cannot let the system choose one: nobody listens there, no test gets it soon.

    The system itself gives ports to connections, from 32768 on (ip_local_port_range), and would give away the
    one that it has just chosen. These lie below: 2000 for each worker, and a second run starts elsewhere.
    """
    while True:
        port = next(_PORTS)
        with suppress(OSError), socket.create_server(("", port)):
            return port


def free_endpoint() -> str:
    """Return an endpoint on loopback at a free port."""
    return f"tcp/127.0.0.1:{free_port()}"


def _ports() -> Iterator[int]:
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")) % 10
    start = 50 * (os.getpid() % 40)
    return (12000 + 2000 * worker + (start + step) % 2000 for step in count())


_PORTS = _ports()
