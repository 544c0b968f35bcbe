"""Latencies of device messages on their three ways through a session, in histograms of bounded size."""

from __future__ import annotations

import threading
from array import array
from collections.abc import Iterable

import numpy as np

from schemas.trocar_msgs import Latency

__all__ = ["Histogram", "Latencies", "by_way"]

_BITS = 5
"""Each doubling of time has 2^5 bins: a percentile is right within 1/32 of itself."""
_BINS = 64 << _BITS
"""Number of bins: as many doublings as an integer of 64 bits has."""


class Histogram:
    """Counts of times in bins; the bin width grows with the time, the memory never grows."""

    def __init__(self) -> None:
        self._counts = array("Q", bytes(8 * _BINS))
        self._totals_ns = array("d", bytes(8 * _BINS))
        self.largest_ns = 0

    @property
    def count(self) -> int:
        """The number of times counted."""
        return int(np.frombuffer(self._counts, np.uint64).sum())

    def add(self, time_ns: int) -> None:
        """Count a time; below zero (two clocks, one offset) counts as zero."""
        if time_ns < 0:
            time_ns = 0
        shift = time_ns.bit_length() - _BITS - 1
        index = time_ns if shift <= 0 else (shift << _BITS) + (time_ns >> shift)
        self._counts[index] += 1
        self._totals_ns[index] += time_ns
        if time_ns > self.largest_ns:
            self.largest_ns = time_ns

    def percentile(self, share: float) -> float:
        """Return the time (ns) at the quantile `share` of all times: the mean of the bin.

        Raises ValueError if no time was counted.
        """
        passed = np.frombuffer(self._counts, np.uint64).cumsum()
        if not passed[-1]:
            raise ValueError("a histogram without times has no percentile")
        index = int(np.searchsorted(passed, max(share * float(passed[-1]), 1.0)))
        return self._totals_ns[index] / self._counts[index]

    def message(self, way: str, stream: str) -> Latency:
        """Return the message about a stream on the way `way`; raises ValueError if no time was counted."""
        p50_s, p99_s = (self.percentile(share) / 1e9 for share in (0.5, 0.99))
        return Latency(
            way=way,
            stream=stream,
            count=self.count,
            p50_s=p50_s,
            p99_s=p99_s,
            largest_s=self.largest_ns / 1e9,
        )


class Latencies:
    """A histogram for each stream; thread-safe."""

    def __init__(self) -> None:
        self._histograms: dict[tuple[str, str], Histogram] = {}
        self._lock = threading.Lock()

    def add(self, way: str, stream: str, time_ns: int) -> None:
        """Count a time of a stream on a way: `device to grant`, `grant to state` or `state to force`."""
        with self._lock:
            histogram = self._histograms.get((way, stream))
            if histogram is None:
                histogram = self._histograms[way, stream] = Histogram()
            histogram.add(time_ns)

    def messages(self) -> list[Latency]:
        """Return the percentiles of every stream, by way and name."""
        with self._lock:
            return [histogram.message(*key) for key, histogram in sorted(self._histograms.items())]


def by_way(latencies: Iterable[Latency]) -> dict[str, dict[str, dict[str, float]]]:
    """Return latencies in the form of a summary: by way and stream, the numbers."""
    rows: dict[str, dict[str, dict[str, float]]] = {}
    for one in latencies:
        rows.setdefault(one.way, {})[one.stream] = {
            "count": one.count,
            "p50_s": one.p50_s,
            "p99_s": one.p99_s,
            "largest_s": one.largest_s,
        }
    return rows
