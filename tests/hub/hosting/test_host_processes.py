from hub.hosting import host_processes as fleet_module
from hub.hosting.host_processes import HostProcesses


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
