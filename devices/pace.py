"""How often a device is asked."""

from __future__ import annotations

__all__ = ["Pace"]

_RETRY_NS = 1_000_000_000
"""What is not there is looked for once a second: to start a runtime or to log in takes seconds."""


class Pace:
    """At most `rate` times a second, and once a second while it fails."""

    def __init__(self, rate: float) -> None:
        """Take the rate, Hz."""
        self._period_ns, self._due_ns = round(1e9 / rate), 0

    def due(self, t: int) -> bool:
        """Say whether the device is to be asked at `t` (ns), and count it as asked if so."""
        if t < self._due_ns:
            return False
        self._due_ns = max(self._due_ns + self._period_ns, t)
        return True

    def failed(self, t: int) -> None:
        """Let it rest from `t` on before it is tried again."""
        self._due_ns = t + _RETRY_NS
