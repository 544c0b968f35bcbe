"""The host processes of a session: started and ended by the hub."""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Mapping
from time import monotonic

from hub.hosting.end_with_parent import NEEDS_INPUT
from hub.hosting.numerics import pin_numerics
from hub.transport.host_link import HubLink

__all__ = ["HostProcesses"]

log = logging.getLogger(__name__)

_END_S = 3.0
"""How long a process may take to close its participants before it is killed."""


class HostProcesses:
    """The host processes that the hub has started.

    A thread waits for the end of each, so that it is known at once, on every system.

    Args:
        links: By host, its link; a host that has none answers over Zenoh.
    """

    def __init__(self, links: Mapping[str, HubLink] | None = None) -> None:
        self.links = links or {}
        self._processes: dict[str, subprocess.Popen[bytes]] = {}
        self._waiting: dict[str, threading.Thread] = {}
        self._changed = threading.Event()

    def start(self, host: str, endpoint: str, session: str) -> None:
        """Start host `host`. It joins over `endpoint`; what it prints goes to stderr.

        It ends when the calling thread does: on Linux that thread is its parent.
        """
        command = [
            sys.executable,
            "-P",
            "-m",
            "hub.hosting.host_process",
            "--hub",
            str(os.getpid()),
            "--connect",
            endpoint,
            "--session",
            session,
            "--host",
            host,
        ]
        link = self.links.get(host)
        inherited = () if link is None else link.inherited
        if inherited:
            command += ["--link", *map(str, inherited)]
        environment = dict(os.environ)
        pin_numerics(environment)
        process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE if NEEDS_INPUT else subprocess.DEVNULL,
            stdout=sys.stderr.fileno(),
            env=environment,
            start_new_session=True,
            pass_fds=inherited,
        )
        if link is not None:
            link.started()
        waiting = threading.Thread(target=self._wait, args=(process,), name=f"host {host}", daemon=True)
        waiting.start()
        self._waiting[host] = waiting
        # a new dictionary: the watchdog's thread may be iterating over the old one
        self._processes = {**self._processes, host: process}

    def _wait(self, process: subprocess.Popen[bytes]) -> None:
        process.wait()
        self._changed.set()  # `dead` may miss it this once, if the process ends while it is started

    def dead(self) -> dict[str, str]:
        """Return, for each host whose process has ended, how it ended."""
        return {
            host: _how(process.returncode)
            for host, process in self._processes.items()
            if process.returncode is not None
        }

    def wait(self, limit_s: float) -> None:
        """Wait until a process ends or `wake` is called, at most `limit_s`."""
        if self._changed.wait(limit_s):
            self._changed.clear()

    def wake(self) -> None:
        """Make `wait` return, in another thread."""
        self._changed.set()

    def end(self) -> None:
        """Wait for the hosts, which end once the hub's token is gone; kill those that do not."""
        deadline = monotonic() + _END_S
        for host, process in self._processes.items():
            self._waiting[host].join(max(deadline - monotonic(), 0.0))
            if process.returncode is None:
                log.warning("host '%s' (pid %d) does not end: killing it", host, process.pid)
                process.kill()
                self._waiting[host].join()
            if process.stdin is not None:
                process.stdin.close()
        for link in self.links.values():
            link.close()


def _how(code: int) -> str:
    if code >= 0:
        return f"its process ended with exit code {code}"
    try:
        return f"its process was killed by {signal.Signals(-code).name}"
    except ValueError:
        return f"its process was killed by signal {-code}"
