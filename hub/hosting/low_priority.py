"""Lets a process of observers run where the rest leave a core free.

A renderer without a GPU keeps all cores busy for some milliseconds per picture. The step loop then shares a
core with the renderer, and simulated time slips for a picture without any hurry.
"""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

__all__ = ["NICE", "lower_priority"]

NICE = 10
"""Nice value, at most 19. Where both want a core, Linux gives a tenth of a core to a process with this value
(weights 110 and 1024 of sched_prio_to_weight, kernel/sched/core.c).
"""
_THREADS = Path("/proc/self/task")
_AUTOGROUP = Path("/proc/self/autogroup")


def lower_priority() -> None:
    """Lower the priority of all threads of the process, of threads started later, and of the autogroup.

    Inherited real-time priority (`chrt trocar run`) is given up. Linux puts each session of processes into an
    autogroup, and each host is a separate session: between autogroups only their own nice values count
    (sched(7)). Does nothing on systems without nice values.
    """
    if _THREADS.exists():
        lower = os.getpriority(os.PRIO_PROCESS, 0) + NICE
        for thread in _THREADS.iterdir():
            with suppress(ProcessLookupError):  # the thread has ended since
                os.setpriority(os.PRIO_PROCESS, int(thread.name), lower)
    elif hasattr(os, "nice"):
        os.nice(NICE)
    if hasattr(os, "sched_setscheduler") and os.sched_getscheduler(0) in (os.SCHED_FIFO, os.SCHED_RR):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    with suppress(OSError):  # there are no autogroups, or none may be written: the nice value is all
        _AUTOGROUP.write_text(str(NICE))
