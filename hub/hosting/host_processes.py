"""The host processes of a session: started and ended by the hub."""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import sys
from time import monotonic

from hub.hosting.blas import pin_blas

__all__ = ["HostProcesses"]

log = logging.getLogger(__name__)

_END_S = 3.0
"""How long a process may take to close its participants before it is killed."""


class HostProcesses:
    """The host processes that the hub has started."""

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
        # a new dictionary: the watchdog's thread may be iterating over the old one
        self._processes = {**self._processes, host: process}

    def dead(self) -> dict[str, str]:
        """Return, for each host whose process has ended, how it ended."""
        return {
            host: _how(process.returncode)
            for host, process in self._processes.items()
            if process.poll() is not None
        }

    def end(self) -> None:
        """Wait for the hosts, which end once the hub's token is gone; kill those that do not."""
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
