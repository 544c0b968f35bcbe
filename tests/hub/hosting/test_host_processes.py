import os
import signal
from queue import Queue

from hub.hosting import host_processes as fleet_module
from hub.hosting import watchdog as watchdog_module
from hub.hosting.host_processes import HostProcesses
from hub.hosting.watchdog import Watchdog
from tests.hub.authorities import free_endpoint
from tests.hub.parts import Part, out, plan_of
from tests.hub.processes import hosts
from tests.waiting import until


def test_hosts_may_be_started_while_the_watchdog_checks_processes(monkeypatch):
    processes = HostProcesses()

    class Process:
        """Lives, and lets another host start at the very moment it is looked at."""

        stdin = None

        def __init__(self, *_, **__):
            pass

        def wait(self):
            pass

        @property
        def returncode(self):
            if "two" not in started:
                started.append("two")
                processes.start("two", "tcp/127.0.0.1:1", "session")

    started = ["one"]
    monkeypatch.setattr(fleet_module.subprocess, "Popen", Process)
    processes.start("one", "tcp/127.0.0.1:1", "session")
    assert processes.dead() == {}
    assert started == ["one", "two"]


def test_the_end_of_a_process_is_noticed_without_waiting_for_the_next_look(monkeypatch, caplog):
    monkeypatch.setattr(watchdog_module, "_PERIOD_S", 1000.0)
    endpoint, processes, failures = free_endpoint(), HostProcesses(), Queue()
    plan = plan_of(Part("source", out()), specs={"source": {"host": "one"}})
    watchdog = Watchdog(plan, processes, 10**12, lambda: None, lambda *failure: failures.put(failure))
    processes.start("one", endpoint, "session")
    try:
        # a process has its command line only a moment after its start
        (number,) = until(lambda: hosts(endpoint))
        os.kill(number, signal.SIGKILL)
        assert failures.get(timeout=60.0) == ("source", "its process was killed by SIGKILL")
        assert "participant 'source': its process was killed by SIGKILL" in caplog.text
    finally:
        watchdog.end()
        processes.end()
