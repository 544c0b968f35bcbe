"""Arbitration of an arm between programs: one program at a time.

The real system obeys every program at once, so two programs drag an arm to and fro. Here the first program
keeps the arm during its move and, unless it leaves, for a second after its last command. Every program may
always stop an arm: `hold`, `free` and `state_command` are accepted from all.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from time import monotonic_ns

__all__ = ["CommandArbiter"]

_KEPT_NS = 1_000_000_000
"""Time until an arm is free after the last command, as long as the connection_timeout of a CRTK client."""


class CommandArbiter:
    """Grants an arm to one program at a time; for use from any thread."""

    def __init__(self, present_name: Callable[[str], str | None] = lambda name: name) -> None:
        """`present_name`: returns the present name of a program; None: the program has left."""
        self._present_name = present_name
        self.busy = False
        """Whether the arm is moving, from the operating state."""
        self._client, self._until_ns = "", 0
        self._deciding = threading.Lock()

    def refusal(self, client: str) -> str | None:
        """Give the arm to `client` and return None, or return why not while another program has the arm."""
        with self._deciding:
            now_ns = monotonic_ns()
            present = self._present_name(self._client) if self._client else None
            kept = self.busy or (now_ns < self._until_ns and present is not None)
            if self._client and kept and client not in (self._client, present):
                return (
                    f"{client} may not move the arm while {self._client} commands it; hold, free and"
                    " state_command are accepted"
                )
            self._client, self._until_ns = client, now_ns + _KEPT_NS
            return None
