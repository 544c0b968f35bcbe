"""How long things take: bounded histograms of times, and the three ways of a device's messages through a session."""

from __future__ import annotations

import threading
from collections.abc import Iterable

from schemas.trocar_msgs import Latency

__all__ = ["Histogram", "Latencies", "by_way"]

_BITS = 5
"""Each doubling of time has 2^5 bins: a percentile is right within 1/32 of itself."""


class Histogram:
    """Counts of times in bins whose width grows with the time; memory is bounded by the number of bits of a time (64 x 32 bins at most)."""

    def __init__(self) -> None:
        self._bins: dict[int, list[int]] = {}
        self.count = 0
        self.largest_ns = 0

    def add(self, time_ns: int) -> None:
        """Count one time; below zero (two clocks, one offset) counts as zero."""
        time_ns = max(time_ns, 0)
        shift = max(time_ns.bit_length() - _BITS - 1, 0)
        counted = self._bins.setdefault((shift << _BITS) + (time_ns >> shift), [0, 0])
        counted[0] += 1
        counted[1] += time_ns
        self.count += 1
        self.largest_ns = max(self.largest_ns, time_ns)

    def percentile(self, share: float) -> float:
        """Return the time (ns) below which `share` of all times are: the mean of its bin. Raises ValueError of nothing."""
        rank, passed = share * self.count, 0
        for index in sorted(self._bins):
            count, total_ns = self._bins[index]
            passed += count
            if passed >= rank:
                return total_ns / count
        raise ValueError("no percentile of nothing")


class Latencies:
    """A histogram for each stream. For use from any thread."""

    def __init__(self) -> None:
        self._histograms: dict[tuple[str, str], Histogram] = {}
        self._lock = threading.Lock()

    def add(self, way: str, stream: str, time_ns: int) -> None:
        """Count one time of a stream on its way: `device to grant`, `grant to state` or `state to force`."""
        with self._lock:
            if (way, stream) not in self._histograms:
                self._histograms[way, stream] = Histogram()
            self._histograms[way, stream].add(time_ns)

    def messages(self) -> list[Latency]:
        """Return the percentiles of every stream, by way and name."""
        with self._lock:
            found = sorted(self._histograms.items())
            return [
                Latency(way=way, stream=stream, count=h.count, p50_s=h.percentile(0.5) / 1e9, p99_s=h.percentile(0.99) / 1e9, largest_s=h.largest_ns / 1e9)
                for (way, stream), h in found
            ]


def by_way(latencies: Iterable[Latency]) -> dict[str, dict[str, dict[str, float]]]:
    """Return latencies as a summary has them: way, stream, and its numbers."""
    rows: dict[str, dict[str, dict[str, float]]] = {}
    for one in latencies:
        rows.setdefault(one.way, {})[one.stream] = {"count": one.count, "p50_s": one.p50_s, "p99_s": one.p99_s, "largest_s": one.largest_s}
    return rows
