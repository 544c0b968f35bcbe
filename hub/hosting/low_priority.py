"""Lets a process that only looks on run where the others leave a core free.

A renderer without a GPU keeps all cores busy for some milliseconds per picture. The step loop then shares its
core with it, and simulated time slips for a picture that may as well be drawn a little later.
"""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

__all__ = ["NICE", "lower_priority"]

NICE = 10
"""Of 19: where both want a core, the scheduler of Linux gives one part in ten to a process with this value
(weights 110 and 1024 of sched_prio_to_weight, kernel/sched/core.c).
"""
_AUTOGROUP = Path("/proc/self/autogroup")


def lower_priority() -> None:
    """Lower the priority of the calling thread, of all threads that it starts, and of its autogroup.

    Real-time priority that was inherited (`chrt trocar run`) is given up. Linux puts each session of
    processes into an autogroup, and a host is a session of its own: between autogroups only their own nice
    values count (sched(7)). Does nothing on systems without nice values.
    """
    if hasattr(os, "nice"):
        os.nice(NICE)
    if hasattr(os, "sched_setscheduler") and os.sched_getscheduler(0) in (os.SCHED_FIFO, os.SCHED_RR):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    with suppress(OSError):  # there are no autogroups, or none may be written: the nice value is all
        _AUTOGROUP.write_text(str(NICE))
