"""A limit on messages per second, which allows those of one second at once."""

from __future__ import annotations

__all__ = ["RateLimit"]


class RateLimit:
    """A token bucket: it fills at `rate` messages per second, and holds those of one second at most."""

    def __init__(self, rate: float) -> None:
        self.rate = rate
        self._left = self._most = max(rate, 1.0)
        self._checked_ns = 0

    def allow(self, now_ns: int) -> bool:
        """Return whether a message that arrives now is within the limit, and count it if it is."""
        self._left = min(self._left + (now_ns - self._checked_ns) * 1e-9 * self.rate, self._most)
        self._checked_ns = now_ns
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True
