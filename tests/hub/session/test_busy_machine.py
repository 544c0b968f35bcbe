"""Sessions that start while other work takes the processors."""

import os
import subprocess
import sys
from contextlib import ExitStack, contextmanager

import pytest

from trocar import run

ENDLESS = "import os; parent = os.getppid()\nwhile os.getppid() == parent: pass"  # not longer than the tests
BUSY = [sys.executable, "-P", "-c", ENDLESS]


@contextmanager
def busy_machine():
    """Four loops on each processor, each a session of processes as the terminals of other people are."""
    with ExitStack() as stack:
        for _ in range(4 * len(os.sched_getaffinity(0))):
            loop = stack.enter_context(subprocess.Popen(BUSY, start_new_session=True))
            stack.callback(loop.kill)
        yield


@pytest.mark.alone
@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere seconds of a busy machine count")
def test_a_session_with_a_camera_starts_on_a_busy_machine():
    # a picture of the wound takes a second or so of processor time, and several times that beside the loops
    with busy_machine():
        summary = run("suturing", set={"duration": "10 ms", "answer_limit": "2 s", "join_limit": "10 s"})
    assert summary.state == "done"
