"""The router of clients without the secret of a session: programs of other makers, and the gate.

ROS programs look for a router on loopback and know no password. A gate cannot have a password either: Zenoh
would demand the password of clients with a certificate too. So programs and gate connect to a router of their
own, connected to the hub's router for a gate only; then access rules hold programs to the keys shared by
devices (docs/decisions/0038-secret-of-a-session.md).
"""

from __future__ import annotations

import logging
import os
import tempfile
from collections.abc import Generator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from hub.security.access import ALL_MESSAGES, allow
from hub.transport.loopback_port import LoopbackPort
from hub.transport.session_secret import private_directory
from hub.transport.zenoh_session import open_session

__all__ = ["OuterRouter"]

log = logging.getLogger(__name__)

_BY_FILE = "unixsock-stream"


class OuterRouter:
    """A router beside the router of a hub.

    Args:
        port: Port for programs; None: no device shares keys with programs without the session's secret.
        foreign_keys: Keys shared with programs by devices.
        gated: The hub has a gate.
    """

    def __init__(self, port: LoopbackPort | None, foreign_keys: Sequence[str], *, gated: bool) -> None:
        self._port, self._foreign_keys, self._gated = port, list(foreign_keys), gated
        self.inside: list[str] = []
        """Endpoint of the open router for hub and gate, if there is a gate."""

    @property
    def programs(self) -> str:
        """Endpoint for programs; empty without a port."""
        return "" if self._port is None else self._port.endpoint

    @contextmanager
    def opened(self) -> Generator[None]:
        """Listen. Raises ConnectError if a port is taken."""
        with ExitStack() as stack:
            security: dict[str, Any] = {}
            if self._gated:
                self.inside = [stack.enter_context(_private_endpoint())]
                security = _rules(self._foreign_keys)
            if self._port is not None:
                stack.enter_context(self._port.listen(security=security, listen=self.inside))
                log.info("programs that share keys with devices may connect at %s", self.programs)
            elif self._gated:
                stack.enter_context(open_session("router", listen=self.inside, security=security))
            yield


@contextmanager
def _private_endpoint() -> Generator[str]:
    """Yield an endpoint for processes of this user only; on Windows, for any process of this machine.

    Zenoh has no sockets with rights of files on Windows.
    """
    if os.name == "nt":
        port = LoopbackPort("tcp/127.0.0.1:0")
        port.release()
        yield port.endpoint
        return
    with tempfile.TemporaryDirectory(dir=private_directory()) as directory:
        yield f"{_BY_FILE}/{Path(directory, 'gate')}"


def _rules(foreign_keys: Sequence[str]) -> dict[str, Any]:
    """Return Zenoh's settings to hold TCP clients to `foreign_keys`."""
    everything = ["**", *foreign_keys]  # `**` does not match chunks that begin with @
    local = [_BY_FILE] if os.name != "nt" else [_BY_FILE, "tcp"]
    rules = {"hub and gate": (local, everything)}
    if foreign_keys:
        rules["programs"] = ["tcp"], list(foreign_keys)
    return {
        "access_control": {
            "enabled": True,
            "default_permission": "deny",
            "rules": [
                {"id": name, **allow("both", ALL_MESSAGES, *keys)} for name, (_, keys) in rules.items()
            ],
            "subjects": [{"id": name, "link_protocols": links} for name, (links, _) in rules.items()],
            "policies": [{"subjects": [name], "rules": [name]} for name in rules],
        }
    }
