"""Opens Zenoh sessions, all with the same settings."""

from __future__ import annotations

import atexit
import json
import threading
from collections.abc import Mapping, Sequence
from time import monotonic
from typing import Any

import zenoh

from schemas.errors import ConnectError

__all__ = ["LEASE_MS", "open_session"]

LEASE_MS = 10_000
"""A peer silent for this long is gone.

The end of a process is known at once, by the closing of the sockets; a process on a busy machine may be
silent for seconds.
"""

_CALLBACK_THREAD = "(pyo3-closure)"
"""End of the name of a thread in which Zenoh's Python binding calls a function."""
_PATIENCE_S = 2.0
"""Longest wait for such threads: those of a session still open stay for ever, asleep."""
_EVENT_BATCHES = 16
"""Batches of 64 KiB for events waiting to be sent, the most Zenoh allows: three pictures.

With Zenoh's default, two, the second picture of a stereo pair was dropped now and then while the first was
sent.
"""


def open_session(
    mode: str,
    *,
    listen: Sequence[str] = (),
    connect: Sequence[str] = (),
    security: Mapping[str, Any] | None = None,
    alone: bool = False,
) -> zenoh.Session:
    """Open a Zenoh session without scouting, listening and connecting only at the given endpoints.

    `security`: Zenoh's settings of TLS and of access, from `hub.security.credentials` and
    `hub.security.access`. `alone`: a router without further routers; no wait of half a second for others.

    Raises ConnectError if an endpoint cannot be opened or reached.
    """
    config = zenoh.Config()
    settings: dict[str, Any] = {
        "mode": mode,
        "scouting/multicast/enabled": False,
        "listen/endpoints": list(listen),
        "connect/endpoints": list(connect),
        "connect/timeout_ms": 5000,
        "connect/exit_on_failure": True,
        # of two hosts one connects: where both do at once, and passwords are checked, both may give up
        "scouting/gossip/autoconnect_strategy": {"peer": {"to_router": "always", "to_peer": "greater-zid"}},
        "transport/link/tx/lease": LEASE_MS,
        "transport/link/tx/queue/size/interactive_high": _EVENT_BATCHES,
        "transport/shared_memory/enabled": False,  # its segments outlive a process that is killed
        **({"scouting/delay": 0} if alone else {}),
        **(security or {}),
    }
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        where = f"listen on {', '.join(listen)}" if listen else f"reach {', '.join(connect)}"
        raise ConnectError(f"cannot {where}: {error}") from error


@atexit.register
def _await_callbacks() -> None:
    """Wait for the threads of closed sessions to end.

    One that wakes up in an interpreter at its end aborts the process, after all work is done. Python waits
    by itself for those that a daemon thread has not started.
    """
    due_s = monotonic() + _PATIENCE_S
    for thread in threading.enumerate():
        if thread.name.endswith(_CALLBACK_THREAD):
            thread.join(max(0.0, due_s - monotonic()))
