"""The processor time of each thread of this process, by purpose of the thread.

Linux counts nanoseconds (`/proc/self/task/TID/schedstat`, field 1; proc(5)). Elsewhere all time counts as the
main thread's.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from pathlib import Path
from time import process_time_ns

__all__ = ["CoreQueue", "ThreadClocks"]

_TASKS = Path("/proc/self/task")
_WIRE = ("app-", "net-", "acc-", "rx-", "tx-", "tokio")
"""How the names of Zenoh's threads begin."""


class ThreadClocks:
    """Sums the processor time of all threads since `restart`.

    Args:
        taker: Returns the purpose of a Python thread, by the thread's name.
        native: The purpose of threads of libraries except Zenoh.
    """

    def __init__(self, taker: Callable[[str], str], native: str) -> None:
        self._taker, self._native = taker, native
        self._main = threading.main_thread().native_id or 0
        self._lock = threading.Lock()
        self._seen: dict[int, tuple[str, int]] = {}
        self._ended: dict[str, int] = {}
        self._from: dict[str, int] = {}
        self._process_from_ns = self._main_from_ns = 0

    def restart(self) -> None:
        """Count from now."""
        self._from = self._taker_totals()
        self._process_from_ns = process_time_ns()
        self._main_from_ns = _core_ns(self._main) or 0

    def main_ns(self) -> int:
        """Return the processor time of the main thread; of all threads where unknown."""
        now_ns = _core_ns(self._main)
        return process_time_ns() - self._process_from_ns if now_ns is None else now_ns - self._main_from_ns

    def other_ns(self, main_ns: int) -> dict[str, float]:
        """Return the processor time of the other threads, by purpose.

        `main_ns` is the main thread's time; time of the process outside of the known threads belongs to
        `other threads`.
        """
        times: dict[str, float] = {
            taker: total - self._from.get(taker, 0) for taker, total in self._taker_totals().items()
        }
        rest = process_time_ns() - self._process_from_ns - main_ns - sum(times.values())
        times["other threads"] = times.get("other threads", 0.0) + max(rest, 0.0)
        return {taker: time_ns for taker, time_ns in times.items() if time_ns > 0.0}

    def _taker_totals(self) -> dict[str, int]:
        """Return the processor time of every taker so far, including ended threads."""
        names = {thread.native_id: thread.name for thread in threading.enumerate()}
        with self._lock:
            seen: dict[int, tuple[str, int]] = {}
            for directory in _TASKS.iterdir() if _TASKS.exists() else ():
                task = int(directory.name)
                time_ns = _core_ns(task)
                if task != self._main and time_ns is not None:
                    seen[task] = self._of(task, names.get(task), time_ns), time_ns
            for task, (taker, time_ns) in self._seen.items():
                if seen.get(task, ("", -1))[1] < time_ns:
                    self._ended[taker] = self._ended.get(taker, 0) + time_ns
            self._seen, totals = seen, dict(self._ended)
        for taker, time_ns in seen.values():
            totals[taker] = totals.get(taker, 0) + time_ns
        return totals

    def _of(self, task: int, name: str | None, time_ns: int) -> str:
        """Return the purpose of a thread; `name` is Python's name, if Python has started the thread.

        Python forgets a thread shortly before the thread's end: then the last known purpose counts.
        """
        if name is not None:
            return self._taker(name)
        known, then_ns = self._seen.get(task, ("", 0))
        if known and then_ns <= time_ns:
            return known
        try:
            own = (_TASKS / str(task) / "comm").read_text(encoding="utf-8")
        except OSError:
            return "other threads"
        return "wire" if own.startswith(_WIRE) else self._native


def _core_ns(task: int) -> int | None:
    """Return the processor time of a thread; None if ended, or if the system does not tell."""
    try:
        return int((_TASKS / str(task) / "schedstat").read_bytes().split()[0])
    except (OSError, IndexError):
        return None


class CoreQueue:
    """How long a thread could have run and had no core (field 2 of `schedstat`)."""

    def __init__(self) -> None:
        """Watch the calling thread, where the system knows this time."""
        try:
            self._file = os.open("/proc/thread-self/schedstat", os.O_RDONLY)
        except OSError:
            self._file = None

    def waited_ns(self) -> int:
        """Return the time so far; 0 where unknown."""
        return 0 if self._file is None else int(os.pread(self._file, 64, 0).split()[1])

    def close(self) -> None:
        """Watch no more."""
        if self._file is not None:
            os.close(self._file)
            self._file = None
