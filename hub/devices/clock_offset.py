"""The offset of the hub's clock from that of a device's host: four timestamps an exchange, the best of 16.

The clocks are the monotonic ones of both machines, so that setting a wall clock does not disturb it.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["ClockExchange", "ClockOffset"]

_WINDOW = 16
_DRIFT = 15e-6
"""The largest drift between two clocks, s/s: PHI of NTP's clock filter, RFC 5905 section 7.1."""


@dataclass(frozen=True)
class ClockExchange:
    """A query for the time of the hub, and its answer."""

    asked_ns: int
    """By the device host's clock, as is `answered_ns`."""
    received_ns: int
    """By the hub's clock, as is `replied_ns`."""
    replied_ns: int
    answered_ns: int

    @property
    def offset_ns(self) -> int:
        """The hub's clock minus the host's, if both ways take equally long (RFC 5905, section 8)."""
        return (self.received_ns - self.asked_ns + self.replied_ns - self.answered_ns) // 2

    @property
    def round_trip_ns(self) -> int:
        """Time on the way, there and back; half of it bounds the error of the offset."""
        return max(self.answered_ns - self.asked_ns - (self.replied_ns - self.received_ns), 0)

    def error_ns(self, now_ns: int) -> float:
        """Return the bound of the offset's error at `now_ns`: the clocks drift."""
        return self.round_trip_ns / 2 + _DRIFT * abs(now_ns - self.answered_ns)


class ClockOffset:
    """The offset of two clocks, from the exchange with the smallest error among the last ones."""

    def __init__(self) -> None:
        self._exchanges: tuple[ClockExchange, ...] = ()
        self.best: ClockExchange | None = None
        """The exchange with the smallest error, None before the first.

        It stays the best until the next one, as the errors of all grow at the same rate.
        """

    def add(self, exchange: ClockExchange) -> None:
        """Add an exchange.

        If it contradicts those before (a clock has stood still or jumped), they are forgotten.
        """
        now_ns, best = exchange.answered_ns, self.best
        if (
            best is not None
            and abs(best.offset_ns - exchange.offset_ns)
            > best.error_ns(now_ns) + exchange.error_ns(now_ns) + 2
        ):
            self._exchanges = ()
        self._exchanges = (*self._exchanges, exchange)[-_WINDOW:]
        self.best = min(self._exchanges, key=lambda exchange: exchange.error_ns(now_ns))
