"""The other processes of a session: started, watched and ended by the hub."""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from time import monotonic, monotonic_ns

from hub.hosting.blas import pin_blas
from hub.planning.plan import Plan

__all__ = ["HostProcesses", "Watchdog"]

log = logging.getLogger(__name__)

_LOOK_S = 0.02
"""How often processes are looked after: a death is told within 100 ms with room to spare."""

_END_S = 3.0
"""How long a process may take to close its participants before it is killed."""


class HostProcesses:
    """The host processes that this hub has started."""

    def __init__(self) -> None:
        self._processes: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, host: str, endpoint: str, session: str) -> None:
        """Start host `host`. It joins over `endpoint`; what it prints goes to stderr."""
        command = [
            sys.executable,
            "-P",
            "-m",
            "hub.hosting.host_process",
            "--connect",
            endpoint,
            "--session",
            session,
            "--host",
            host,
        ]
        environment = dict(os.environ)
        pin_blas(environment)
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=sys.stderr.fileno(),
            env=environment,
            start_new_session=True,
        )
        # a new one: the watchdog's thread may be looking through the old one
        self._processes = {**self._processes, host: process}

    def dead(self) -> dict[str, str]:
        """Return how each host ended that is no longer there."""
        return {
            host: _how(process.returncode)
            for host, process in self._processes.items()
            if process.poll() is not None
        }

    def end(self) -> None:
        """Wait for the hosts, which end by themselves once the hub's token is gone; kill what does not."""
        deadline = monotonic() + _END_S
        for host, process in self._processes.items():
            try:
                process.wait(max(deadline - monotonic(), 0.0))
            except subprocess.TimeoutExpired:
                log.warning("host '%s' (pid %d) does not end: killing it", host, process.pid)
                process.kill()
                process.wait()


def _how(code: int) -> str:
    if code >= 0:
        return f"its process ended with exit code {code}"
    try:
        return f"its process was killed by {signal.Signals(-code).name}"
    except ValueError:
        return f"its process was killed by signal {-code}"


class Watchdog:
    """Looks after processes and the time that answers take, in a thread of its own."""

    def __init__(
        self,
        plan: Plan,
        processes: HostProcesses,
        answer_limit_ns: int,
        awaited: Callable[[], str | None],
        failed: Callable[[str, str], None],
    ) -> None:
        """`awaited` says who keeps this process from going on; `failed` is called once, with a participant's
        name and the cause.
        """
        self._plan = plan
        self._processes = processes
        self._limit_ns = answer_limit_ns
        self._awaited = awaited
        self._failed = failed
        self._waiting: Sequence[str] = ()
        self._since_ns = 0
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="watchdog", daemon=True)
        self._thread.start()

    def wait_for(self, participants: Sequence[str]) -> None:
        """Say whose answers are waited for from now on, in step order; who answers may be removed from the
        list meanwhile.
        """
        self._since_ns = monotonic_ns()
        self._waiting = participants

    def _run(self) -> None:
        while not self._ending.wait(_LOOK_S):
            failure = self._look()
            if failure is not None:
                self._failed(*failure)
                return

    def _look(self) -> tuple[str, str] | None:
        for host, how in self._processes.dead().items():
            names = [name for name in self._plan.participants if self._plan.participants[name].host == host]
            missing = [name for name in self._waiting if name in names] or names
            others = (
                f" (host '{host}' also ran {', '.join(n for n in names if n != missing[0])})"
                if len(names) > 1
                else ""
            )
            return missing[0], f"{how}{others}"
        since_ns, waiting = self._since_ns, tuple(self._waiting)
        if waiting and monotonic_ns() - since_ns > self._limit_ns:
            awaited = self._awaited()
            others = (
                ""
                if awaited is not None or len(waiting) == 1
                else f"; nor have {', '.join(waiting[1:])}, which may wait for it"
            )
            return (
                awaited or waiting[0],
                f"it has not answered for {self._limit_ns / 1e9:g} s (answer_limit){others}",
            )
        return None

    def end(self) -> None:
        """Look no more."""
        self._ending.set()
        self._thread.join()
