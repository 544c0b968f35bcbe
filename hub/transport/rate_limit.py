"""How many messages may come: so many a second, and as many as those of a second at once."""

from __future__ import annotations

__all__ = ["RateLimit"]


class RateLimit:
    """A bucket that fills at a rate, at most with the messages of a second."""

    def __init__(self, rate: float) -> None:
        """Take the messages per second."""
        self.rate = rate
        self._left = self._most = max(rate, 1.0)
        self._looked_ns = 0

    def spend(self, now_ns: int) -> bool:
        """Take one message out of the bucket; say whether there was one left."""
        self._left = min(self._left + (now_ns - self._looked_ns) * 1e-9 * self.rate, self._most)
        self._looked_ns = now_ns
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True
