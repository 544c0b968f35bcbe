"""The priority of the processes of the haptic loop: a hand would feel a delay."""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys

__all__ = ["SERVO", "WATCHER", "raise_priority"]

SERVO, WATCHER = 19, 20
"""SCHED_FIFO: above all ordinary threads, below the kernel's interrupt threads (50). The watcher is above the
servo: a servo without sleep must not delay the watcher. limits.conf allows a user the larger number.
"""
_HIGH_PRIORITY_CLASS = 0x80


def raise_priority(fifo: int) -> str:
    """Raise the priority of this process as far as the system allows; return the priority reached.

    On Linux `fifo` with SCHED_FIFO (`real-time`), on Windows the class `high`; else `normal`.
    """
    if sys.platform == "win32":
        kernel = ctypes.windll.kernel32
        kernel.GetCurrentProcess.restype = ctypes.c_void_p
        kernel.SetPriorityClass.argtypes = (ctypes.c_void_p, ctypes.c_uint)
        raised = kernel.SetPriorityClass(kernel.GetCurrentProcess(), _HIGH_PRIORITY_CLASS)
        return "high" if raised else "normal"
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(fifo))
        return "real-time"
    return "normal"
