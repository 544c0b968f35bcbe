"""The offset between the clocks of the hub and a device's host: four timestamps, the best of 16 exchanges.

Both clocks are monotonic: setting a wall clock does not disturb the offset.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["ClockExchange", "ClockOffset"]

_WINDOW = 16
_DRIFT = 15e-6
"""The largest drift between two clocks, s/s: PHI of NTP's clock filter, RFC 5905 section 7.1."""


@dataclass(frozen=True)
class ClockExchange:
    """A query for the time of the hub, and the answer."""

    asked_ns: int
    """Time by the device host's clock, like `answered_ns`."""
    received_ns: int
    """Time by the hub's clock, like `replied_ns`."""
    replied_ns: int
    answered_ns: int

    @property
    def offset_ns(self) -> int:
        """The hub's clock minus the host's, if both ways take equally long (RFC 5905, section 8)."""
        return (self.received_ns - self.asked_ns + self.replied_ns - self.answered_ns) // 2

    @property
    def round_trip_ns(self) -> int:
        """Time on the way, there and back; half of this time bounds the error of the offset."""
        return max(self.answered_ns - self.asked_ns - (self.replied_ns - self.received_ns), 0)

    def error_ns(self, now_ns: int) -> float:
        """Return the bound of the offset's error at `now_ns`: the clocks drift."""
        return self.round_trip_ns / 2 + _DRIFT * abs(now_ns - self.answered_ns)


class ClockOffset:
    """The offset of two clocks, from the exchange with the smallest error among the last exchanges."""

    def __init__(self) -> None:
        self._exchanges: tuple[ClockExchange, ...] = ()
        self.best: ClockExchange | None = None
        """The exchange with the smallest error, None before the first.

        The best exchange stays until a better exchange, as all errors grow at the same rate.
        """

    def add(self, exchange: ClockExchange) -> None:
        """Add an exchange.

        A contradiction with earlier exchanges (a clock has stood still or jumped) forgets the earlier
        exchanges.
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
