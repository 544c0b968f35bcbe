"""Watches the host processes of a session, and how long participants take to answer."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence
from time import monotonic_ns, process_time_ns

from hub.hosting.host_processes import HostProcesses
from hub.hosting.patience import Patience
from hub.planning.plan import Plan

__all__ = ["Watchdog"]

log = logging.getLogger(__name__)

_PERIOD_S = 0.1
"""Time between two looks at the answers; the end of a process is noticed at once. Each look takes the
interpreter from the step loop: fifty a second were a third of all thread switches of the loop.
"""

_STOPPED_NS = 1_000_000_000
"""Time between two looks if this process was stopped: by Ctrl-Z, a debugger, or with the virtual machine."""


class Watchdog:
    """Checks processes and answers in a thread of its own, until the first failure.

    The end of a process of observers is reported once, and the watch of the others goes on.

    Args:
        plan: The plan of the session.
        processes: The processes to watch.
        answer_limit_ns: Longest time for the answer of a participant, counted by `Patience`.
        awaited: Returns the participant awaited by this process, if known.
        failed: Is called with a participant's name and the cause: once, and at the end of each observer.
    """

    def __init__(
        self,
        plan: Plan,
        processes: HostProcesses,
        answer_limit_ns: int,
        awaited: Callable[[], str | None],
        failed: Callable[[str, str], None],
    ) -> None:
        self._plan, self._processes = plan, processes
        self._patience = Patience(answer_limit_ns)
        self._awaited, self._failed = awaited, failed
        self._waiting: Sequence[str] = ()
        self._ending = False
        self._lost: set[str] = set()
        """The ended hosts of observers."""
        self._thread = threading.Thread(target=self._run, name="watchdog", daemon=True)
        self._thread.start()

    def wait_for(self, participants: Sequence[str]) -> None:
        """Watch for the answers of `participants`, in step order, from now on.

        The caller may remove a participant from the list after the answer.
        """
        self._patience.begin()
        self._waiting = participants

    def _run(self) -> None:
        looked_ns, used_ns = monotonic_ns(), process_time_ns()
        while not self._ending:
            self._processes.wait(_PERIOD_S)
            # time in which this process computed is not silent: a participant may have kept the interpreter
            silent_ns = monotonic_ns() - looked_ns - (process_time_ns() - used_ns)
            looked_ns, used_ns = monotonic_ns(), process_time_ns()
            if silent_ns > _STOPPED_NS:
                log.warning(
                    "the hub did not run for %.1f s: it was stopped, or the machine is too busy",
                    silent_ns / 1e9,
                )
            # while this process was stopped, no answer could be received
            left_out_ns = silent_ns if silent_ns > _STOPPED_NS else 0
            failure = self._ended_process() or self._late_answer(left_out_ns)
            if failure is not None and not self._ending:
                # at once: the main thread may be in a call that nothing interrupts
                log.error("participant '%s': %s", *failure)
                self._failed(*failure)
                return

    def _ended_process(self) -> tuple[str, str] | None:
        """Return a participant of an ended process, and the kind of end; report observers here."""
        for host, how in self._processes.dead().items():
            if host in self._lost:
                continue
            names = [name for name in self._plan.participants if self._plan.participants[name].host == host]
            if self._plan.participants[names[0]].observer:  # it shares its process with observers alone
                self._lost.add(host)
                for name in names:
                    self._failed(name, how)
                continue
            missing = [name for name in self._list_unanswered() if name in names] or names
            others = ", ".join(name for name in names if name != missing[0])
            return missing[0], f"{how} (host '{host}' also ran {others})" if others else how
        return None

    def _late_answer(self, left_out_ns: int) -> tuple[str, str] | None:
        """Return a participant without an answer in time, and the cause."""
        waiting = (
            self._list_unanswered()
        )  # first: the wait may be over, and the next one begin, at any moment
        if not waiting or not self._patience.is_over(self._processes.numbers, left_out_ns):
            return None
        first, *others = waiting
        cause = f"it has not answered for {self._patience.limit_ns / 1e9:g} s (answer_limit)"
        awaited = self._awaited()
        if awaited is None and others:
            cause += f"; nor have {', '.join(others)}, which may wait for it"
        return awaited or first, cause

    def _list_unanswered(self) -> list[str]:
        """Return the awaited participants, without participants already stepped by a host with a link."""
        passed = {name for link in self._processes.links.values() for name in link.passed}
        return [name for name in tuple(self._waiting) if name not in passed]

    def end(self) -> None:
        """Stop watching."""
        self._ending = True
        self._processes.wake()
        self._thread.join()
