"""Ends a process together with its parent, however the parent ends.

Why not by Zenoh alone, as orderly ends are: docs/decisions/0039-ends-of-processes.md.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading

__all__ = ["NEEDS_INPUT", "end_with_parent"]

NEEDS_INPUT = sys.platform != "linux"
"""Whether a caller of `end_with_parent` needs a pipe from the parent as standard input."""

_PR_SET_PDEATHSIG = 1
"""Option of prctl(2), as in linux/prctl.h."""


def end_with_parent(parent: int) -> None:
    """Let this process end with process `parent`.

    On Linux the kernel then kills this process in any condition: also while stopped, or in a call holding
    Python's interpreter lock. Elsewhere a thread waits for the end of the input.
    """
    if NEEDS_INPUT:
        threading.Thread(target=_end_with_input, name="parent", daemon=True).start()
        return
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it had ended before
        os._exit(1)


def _end_with_input() -> None:
    sys.stdin.buffer.read()
    os._exit(1)
