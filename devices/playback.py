"""Samples that were recorded, handed out as time comes to them."""

from __future__ import annotations

from collections.abc import Iterable

from hub.participant import Sample

__all__ = ["Playback"]


class Playback:
    """Hands out each sample once."""

    def __init__(self, samples: Iterable[tuple[int, Sample]] = ()) -> None:
        """Take time (ns) and sample, oldest first; they may go on for ever."""
        self._samples = iter(samples)
        self._next = next(self._samples, None)

    def due(self, t: int) -> list[Sample]:
        """Return the samples up to time `t` (ns) that were not returned before, oldest first."""
        due: list[Sample] = []
        while self._next is not None and self._next[0] <= t:
            due.append(self._next[1])
            self._next = next(self._samples, None)
        return due
