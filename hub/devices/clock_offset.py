"""How far the clock of a device's host is from the hub's: four timestamps an exchange, and the best of the
last exchanges.

The clocks are the monotonic ones of both machines, so that nobody who sets a wall clock disturbs it.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["ClockOffset", "ClockExchange"]

_WINDOW = 16
_DRIFT = 15e-6
"""How far two clocks drift apart at most while nobody looks, s/s: PHI of NTP's clock filter, RFC 5905 section
7.1.
"""


@dataclass(frozen=True)
class ClockExchange:
    """A question to the hub what time it is, and its answer."""

    asked_ns: int
    """By the device host's clock, as is `answered_ns`."""
    received_ns: int
    """By the hub's clock, as is `replied_ns`."""
    replied_ns: int
    answered_ns: int

    @property
    def offset_ns(self) -> int:
        """The hub's clock minus the host's, if the way there takes as long as the way back (RFC 5905, section
        8).
        """
        return (self.received_ns - self.asked_ns + self.replied_ns - self.answered_ns) // 2

    @property
    def round_trip_ns(self) -> int:
        """Time on the way, there and back; half of it is how wrong the offset may be."""
        return max(self.answered_ns - self.asked_ns - (self.replied_ns - self.received_ns), 0)

    def error_ns(self, now_ns: int) -> float:
        """Return how wrong the offset may be by now, as the clocks drift."""
        return self.round_trip_ns / 2 + _DRIFT * abs(now_ns - self.answered_ns)


class ClockOffset:
    """The offset of two clocks, from the exchange of the last ones that is least wrong by now."""

    def __init__(self) -> None:
        """Begin without an exchange."""
        self._exchanges: tuple[ClockExchange, ...] = ()
        self.best: ClockExchange | None = None
        """The exchange whose offset is least wrong, None before the first; it stays so until the next one, as
        all of them go wrong at the same pace.
        """

    def add(self, exchange: ClockExchange) -> None:
        """Take an exchange. One that cannot be true together with those before (a clock stood still or
        jumped) makes them forgotten.
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
