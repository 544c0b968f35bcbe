"""Sessions that start while other work takes the processors."""

import os
import sys

import pytest

from tests.hub.busy_processes import busy_processes
from trocar import run


@pytest.mark.alone
@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere seconds of a busy machine count")
def test_a_session_with_a_camera_starts_on_a_busy_machine():
    # a picture of the wound takes a second or so of processor time, and several times that beside the loops
    with busy_processes(4 * len(os.sched_getaffinity(0))):
        summary = run("suturing", set={"duration": "10 ms", "answer_limit": "2 s", "join_limit": "10 s"})
    assert summary.state == "done"
