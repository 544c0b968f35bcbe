"""Wall-clock stamps of published topics."""

from __future__ import annotations

from time import time_ns

__all__ = ["Stamps"]


class Stamps:
    """The stamps of a topic, strictly increasing: a CRTK client drops a state with an old stamp."""

    def __init__(self) -> None:
        self._last_ns = 0

    def next_ns(self) -> int:
        """Return the wall time (ns), or the last stamp plus 1 ns if the clock was set back."""
        return self.after(time_ns())

    def after(self, time_ns: int) -> int:
        """Return `time_ns`, or the last stamp plus 1 ns if greater."""
        self._last_ns = max(time_ns, self._last_ns + 1)
        return self._last_ns
