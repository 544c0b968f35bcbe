"""The host processes of a session: started and ended by the hub."""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Mapping

from hub.hosting.end_with_parent import NEEDS_INPUT
from hub.hosting.numerics import pin_numerics
from hub.hosting.patience import Patience
from hub.transport.host_link import HubLink
from hub.transport.local_values import Inboxes

__all__ = ["HostProcesses"]

log = logging.getLogger(__name__)

_END_NS = 3_000_000_000
"""Longest time for processes to close their participants before being killed."""
_POLL_S = 0.1


class HostProcesses:
    """The host processes started by the hub.

    A thread waits for the end of each: an end is known at once, on every system.

    Args:
        links: Links by host; a host without a link answers over Zenoh.
        inboxes: The sockets for values between hosts.
    """

    def __init__(self, links: Mapping[str, HubLink] | None = None, inboxes: Inboxes | None = None) -> None:
        self.links = links or {}
        self._inboxes = inboxes
        self._processes: dict[str, subprocess.Popen[bytes]] = {}
        self._waiting: dict[str, threading.Thread] = {}
        self._changed = threading.Event()

    def start(self, host: str, endpoint: str, session: str) -> None:
        """Start host `host`. The host joins over `endpoint`; its output goes to stderr.

        The host ends with the calling thread: on Linux this thread is the parent.
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
        inherited = [] if link is None else [*link.inherited]
        if inherited:
            command += ["--link", *map(str, inherited)]
        for reader, end in ({} if self._inboxes is None else self._inboxes.ends(host)).items():
            command += ["--inbox", reader, str(end.fileno())]
            inherited.append(end.fileno())
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
            link.close_inherited()
        waiting = threading.Thread(target=self._wait, args=(process,), name=f"host {host}", daemon=True)
        waiting.start()
        self._waiting[host] = waiting
        # a new dictionary: the watchdog's thread may be iterating over the old one
        self._processes = {**self._processes, host: process}

    def _wait(self, process: subprocess.Popen[bytes]) -> None:
        process.wait()
        self._changed.set()  # `dead` may miss it this once, if the process ends while it is started

    @property
    def numbers(self) -> list[int]:
        """The ids of the running processes."""
        return [process.pid for process in self._processes.values() if process.returncode is None]

    def dead(self) -> dict[str, str]:
        """Return the kind of end of each ended process, by host."""
        return {
            host: _exit_sentence(process.returncode)
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
        """Wait for the hosts, ending once the hub's token is gone; kill the rest after a time limit."""
        patience = Patience(_END_NS)
        for host, process in self._processes.items():
            while self._waiting[host].is_alive() and not patience.is_over(self.numbers):
                self._waiting[host].join(_POLL_S)
            if process.returncode is None:
                log.warning("host '%s' (pid %d) does not end: killing it", host, process.pid)
                process.kill()
                self._waiting[host].join()
            if process.stdin is not None:
                process.stdin.close()
        for link in self.links.values():
            link.close()
        if self._inboxes is not None:
            self._inboxes.close()


def _exit_sentence(code: int) -> str:
    if code >= 0:
        return f"its process ended with exit code {code}"
    try:
        return f"its process was killed by {signal.Signals(-code).name}"
    except ValueError:
        return f"its process was killed by signal {-code}"
