"""The priority of a process that only looks on."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from hub.hosting.low_priority import NICE

AUTOGROUP = Path("/proc/self/autogroup")
CODE = """
import os, threading
from hub.hosting.low_priority import lower_priority
found, lowered = [], threading.Event()
def note():
    lowered.wait()
    found.append(os.getpriority(os.PRIO_PROCESS, 0))
threads = [threading.Thread(target=note) for _ in range(2)]
threads[0].start()
lower_priority()
lowered.set()
threads[1].start()
[thread.join() for thread in threads]
print(*set(found))
"""


@pytest.mark.skipif(not hasattr(os, "nice"), reason="no nice values here")
def test_threads_started_before_and_later_have_the_lower_priority_too() -> None:
    before = os.getpriority(os.PRIO_PROCESS, 0)
    done = subprocess.run(
        [sys.executable, "-P", "-c", CODE], capture_output=True, text=True, check=True, start_new_session=True
    )
    assert int(done.stdout) == min(before + NICE, 19)


@pytest.mark.skipif(not AUTOGROUP.exists(), reason="no autogroups here")
def test_an_autogroup_of_its_own_has_the_lower_priority_too() -> None:
    before = AUTOGROUP.read_text()
    code = f"{CODE}\nprint(open('{AUTOGROUP}').read())"
    done = subprocess.run(
        [sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True, start_new_session=True
    )
    assert done.stdout.strip().endswith(f"nice {NICE}")
    assert AUTOGROUP.read_text() == before


@pytest.mark.skipif(not hasattr(os, "sched_setscheduler"), reason="no real-time priority here")
def test_real_time_priority_of_the_session_is_given_up() -> None:
    first = "import os\nos.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))"
    last = "print(os.sched_getscheduler(0) == os.SCHED_OTHER)"
    done = subprocess.run(
        [sys.executable, "-P", "-c", f"{first}\n{CODE}\n{last}"],
        capture_output=True,
        text=True,
        check=False,
        start_new_session=True,
    )
    if "PermissionError" in done.stderr:
        pytest.skip("real-time priority is not allowed here")
    assert done.stdout.split()[-1] == "True"
