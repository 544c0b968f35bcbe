"""A rate limit: a number of messages a second, and a bounded burst."""

from __future__ import annotations

__all__ = ["TokenBucket"]


class TokenBucket:
    """Fills at a constant rate up to the size of the bucket; every message uses a token."""

    def __init__(self, rate: float, burst: float | None = None) -> None:
        """Start full.

        Args:
            rate: tokens per second.
            burst: the bucket's size; by default the tokens of a second, at least 1.
        """
        self.rate = rate
        self._tokens = self._size = max(rate, 1.0) if burst is None else burst
        self._filled_ns = 0

    def spend(self, now_ns: int) -> bool:
        """Use a token at `now_ns` of a clock that only goes forward; return whether there was a token."""
        self._tokens = min(self._tokens + (now_ns - self._filled_ns) * 1e-9 * self.rate, self._size)
        self._filled_ns = now_ns
        if self._tokens < 1.0:
            return False
        self._tokens -= 1.0
        return True
