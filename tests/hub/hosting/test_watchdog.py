import os
import signal
import subprocess
import sys
from time import monotonic, sleep

import pytest

WAITING = """
import logging, threading
from hub.hosting.host_processes import HostProcesses
from hub.hosting.watchdog import Watchdog
from hub.planning.plan import Plan

logging.basicConfig(format="%(message)s")
failed = threading.Event()

def report(name, cause):
    print(name, cause, flush=True)
    failed.set()

plan = Plan(step_ns=1, order=(), participants={}, connections=(), from_devices=(), to_devices=(), bonds=())
watchdog = Watchdog(plan, HostProcesses(), 3_000_000_000, lambda: None, report)
watchdog.wait_for(["robot"])
print("waiting", flush=True)
failed.wait()
watchdog.end()
"""


@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="Windows does not stop processes")
def test_time_in_which_the_hub_was_stopped_is_not_that_of_a_participant():
    command = [sys.executable, "-P", "-c", WAITING]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as hub:
        assert hub.stdout.readline() == "waiting\n"
        os.kill(hub.pid, signal.SIGSTOP)
        sleep(3.2)
        os.kill(hub.pid, signal.SIGCONT)
        continued = monotonic()
        out, err = hub.communicate(timeout=60)
    assert "it has not answered for 3 s" in out
    assert monotonic() - continued > 1.0
    assert "the hub did not run for" in err
