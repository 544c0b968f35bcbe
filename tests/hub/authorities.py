"""Certificates for tests: those of a hub and its participants, and those that a stranger may come with."""

import socket
from pathlib import Path
from typing import NamedTuple

from hub.security import certs
from hub.security.credentials import Credentials, load


class Authority(NamedTuple):
    """An authority in a directory of its own, with the hub's certificate for this machine."""

    directory: Path

    @classmethod
    def founded(cls, directory: Path, *hosts: str) -> "Authority":
        certs.found(directory, hosts or ("127.0.0.1", "localhost"), 1)
        return cls(directory)

    def issued(self, name: str, days: float = 1) -> Credentials:
        return load(name, certs.issue(self.directory, name, days))

    def renewed(self, days: float) -> Credentials:
        return load("hub", certs.renew(self.directory, (), days))

    @property
    def hub(self) -> Credentials:
        return load("hub", self.directory)


def free_port() -> int:
    """Return a port that was free a moment ago."""
    with socket.create_server(("127.0.0.1", 0)) as probe:
        return probe.getsockname()[1]


def free_endpoint() -> str:
    """Return an endpoint on loopback whose port was free a moment ago."""
    return f"tcp/127.0.0.1:{free_port()}"
