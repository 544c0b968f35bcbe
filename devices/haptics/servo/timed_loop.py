"""A loop of a fixed rate, for a library without a loop."""

from __future__ import annotations

import threading
from collections.abc import Callable
from time import perf_counter, sleep

__all__ = ["TimedLoop"]

_END_S = 0.1


class TimedLoop:
    """Calls a function at a fixed rate, in a thread with the priority of the starting thread."""

    def __init__(self, rate: float, tick: Callable[[float], bool]) -> None:
        """Start; `tick` gets the time (s of time.perf_counter) and returns True to go on."""
        self._period, self._tick, self._ending = 1.0 / rate, tick, False
        self._thread = threading.Thread(target=self._run, name="servo loop", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End after the present tick."""
        self._ending = True
        self._thread.join(_END_S)

    def _run(self) -> None:
        due = perf_counter()
        while not self._ending and self._tick(perf_counter()):
            due += self._period
            late = perf_counter() - due
            if late > 0.0:
                due += late  # ticks that were missed are not made up for: a hand would feel them as a burst
            else:
                sleep(-late)
