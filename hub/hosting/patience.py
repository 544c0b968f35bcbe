"""A limit on the wait for processes of this machine, not used up by other work on the machine."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from time import monotonic_ns

__all__ = ["Patience"]

_FIRST_LOOK_NS = 500_000_000
"""Most waits are shorter: no process is looked at before."""
_LOOK_PERIOD_NS = 100_000_000
"""A look at a process with many threads takes some ms."""

_RUN_DELAY = 1
"""Place of the time spent waiting on a run queue, ns, in /proc/PID/task/TID/schedstat (Linux,
Documentation/scheduler/sched-stats.rst); the field before is the time spent on a processor.
"""


class Patience:
    """A limit on the time of processes for an answer.

    A second counts only if no thread of the processes was ready to run and waited for a processor: a sleeping
    or computing process uses time up, a process without a processor does not. Linux tells how long threads
    have waited; elsewhere every second counts.

    A thread may begin a wait while another thread checks the wait.

    Args:
        limit_ns: Limit of each wait.
    """

    def __init__(self, limit_ns: int) -> None:
        self.limit_ns = limit_ns
        self.begin()
        self._checked_ns: int | None = None
        """Beginning of the wait checked last; the next three attributes belong to this wait."""
        self._next_look_ns = 0
        self._left_out_ns = 0
        self._run_delays: dict[Path, int] | None = None
        """Run delay by thread, ns; None before the first look."""

    def begin(self) -> None:
        """Begin a wait."""
        self._begun_ns = monotonic_ns()

    def is_over(self, processes: Iterable[int], left_out_ns: int = 0) -> bool:
        """Return whether `processes`, by their numbers, have had their time.

        `left_out_ns` since the last call does not count either. The processes are looked at every 0.1 s.
        """
        begun_ns = self._begun_ns
        if begun_ns != self._checked_ns:
            self._checked_ns, self._left_out_ns, self._run_delays = begun_ns, 0, None
            self._next_look_ns = begun_ns + min(_FIRST_LOOK_NS, self.limit_ns)
        self._left_out_ns += left_out_ns
        if monotonic_ns() < self._next_look_ns:
            return False
        self._next_look_ns = monotonic_ns() + _LOOK_PERIOD_NS
        delays, before = _run_delays(processes), self._run_delays
        if before is not None:
            self._left_out_ns += max((delays[thread] - before.get(thread, 0) for thread in delays), default=0)
        self._run_delays = delays
        return monotonic_ns() - begun_ns - self._left_out_ns > self.limit_ns


def _run_delays(processes: Iterable[int]) -> dict[Path, int]:
    """Return the run delay of each thread of `processes`, ns; none where the system does not tell."""
    found: dict[Path, int] = {}
    for process in processes:
        for file in Path(f"/proc/{process}/task").glob("*/schedstat"):
            with suppress(OSError):  # the thread has ended
                found[file] = int(file.read_text().split()[_RUN_DELAY])
    return found
