"""Processes that take processors away: endless loops that end with the test."""

import subprocess
import sys
from contextlib import ExitStack, contextmanager

ENDLESS = "import os; parent = os.getppid()\nwhile os.getppid() == parent: pass"


@contextmanager
def busy_processes(count):
    """Run `count` loops, each a session of processes as the terminals of other people are."""
    with ExitStack() as stack:
        started = list[subprocess.Popen[bytes]]()
        for _ in range(count):
            command = [sys.executable, "-P", "-c", ENDLESS]
            started.append(stack.enter_context(subprocess.Popen(command, start_new_session=True)))
            stack.callback(started[-1].kill)  # also if the next one does not start
        yield started
