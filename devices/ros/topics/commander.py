"""Who commands an arm: one program at a time.

The real system heeds whoever spoke last, so that two programs drag one arm to and fro. Here the first keeps
the arm while its move lasts and for a second after its last command. Everybody may always stop it: `hold`,
`free` and `state_command` are heeded from all.
"""

from __future__ import annotations

import threading
from time import monotonic_ns

__all__ = ["Commander"]

_KEPT_NS = 1_000_000_000
"""After the last command; a CRTK client takes a connection for lost after as long (its connection_timeout).
"""


class Commander:
    """Of one arm."""

    def __init__(self) -> None:
        """Nobody leads it."""
        self.busy = False
        """Whether the arm moves on its own, as its operating state has it."""
        self._client, self._until_ns = "", 0
        self._deciding = threading.Lock()

    def refusal(self, client: str) -> str | None:
        """Let `client` lead the arm from now on; return why not while another one does."""
        with self._deciding:
            now_ns = monotonic_ns()
            if client != self._client and self._client and (self.busy or now_ns < self._until_ns):
                return (
                    f"{client} is not heeded while {self._client} commands the arm; hold, free and"
                    " state_command are"
                )
            self._client, self._until_ns = client, now_ns + _KEPT_NS
            return None
