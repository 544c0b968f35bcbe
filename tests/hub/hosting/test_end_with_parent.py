import os
import select
import signal
import subprocess
import sys
from contextlib import suppress

import pytest

CHILD = """
import ctypes, os, sys, time
from hub.hosting import end_with_parent as module

if sys.argv[1] == "input":
    module.NEEDS_INPUT = True
module.end_with_parent(int(sys.argv[2]))
print(flush=True)
if sys.argv[1] == "native":
    ctypes.PyDLL(None).sleep(100)  # it keeps the interpreter lock
time.sleep(100)
"""
PARENT = """
import os, subprocess, sys, time

child = subprocess.Popen([sys.executable, "-c", sys.argv[1], sys.argv[2], str(os.getpid())])
print(child.pid, flush=True)
time.sleep(100)
"""
LIMIT_S = 60.0

linux_only = pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a thread waits for the input")


@linux_only
@pytest.mark.parametrize("doing", ["sleep", "native", "stopped"])
def test_a_process_ends_with_a_parent_that_is_killed(doing):
    """The pipe that both write to ends with the last of them."""
    command = [sys.executable, "-c", PARENT, CHILD, doing]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as parent:
        child = int(parent.stdout.readline())
        handle = os.pidfd_open(child)
        try:
            assert parent.stdout.readline() == b"\n"
            if doing == "stopped":
                os.kill(child, signal.SIGSTOP)
            parent.kill()
            parent.wait()
            assert _ended(handle)
        finally:
            parent.kill()
            with suppress(ProcessLookupError):
                signal.pidfd_send_signal(handle, signal.SIGKILL)
            os.close(handle)


@linux_only
def test_a_process_whose_parent_has_ended_before_ends():
    done = subprocess.run(
        [sys.executable, "-c", CHILD, "sleep", "1"], timeout=LIMIT_S, stdout=subprocess.PIPE
    )
    assert (done.returncode, done.stdout) == (1, b"")


def test_elsewhere_a_process_ends_with_its_input():
    command = [sys.executable, "-c", CHILD, "input", "0"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout.readline().strip() == b""
        assert process.poll() is None
        process.stdin.close()
        assert process.wait(LIMIT_S) == 1


def _ended(handle):
    poll = select.poll()
    poll.register(handle, select.POLLIN)
    return bool(poll.poll(LIMIT_S * 1e3))
