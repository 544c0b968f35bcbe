"""The gate of a hub: the only process listening to other machines.

The gate presents the hub's certificate, demands the client's certificate and applies the access rules.
Allowed messages are forwarded to the hub's router over loopback; denials are reported to the hub for the log.
The design: docs/decisions/0027-remote-hosts.md.
"""

from __future__ import annotations

import json
import logging
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from schemas.errors import ConnectError

__all__ = ["OPEN", "Gate"]

log = logging.getLogger(__name__)

OPEN = "open"
"""First line of the listening process."""

_STOP_S = 3.0
_RETRY_S = 1.0


class Gate:
    """The gate, from the side of the hub."""

    def __init__(
        self, endpoints: Sequence[str], security: Mapping[str, Any], revoked: Path | None = None
    ) -> None:
        """Prepare a gate.

        Args:
            endpoints: Where to listen, such as tls/0.0.0.0:7447.
            security: Zenoh's settings of TLS and of access.
            revoked: The list of revoked certificates; after a change, the process starts again.
        """
        self.endpoints = list(endpoints)
        self._security = dict(security)
        self._revoked = revoked
        self._closing = threading.Event()
        self._starting = threading.Lock()
        self._reader: threading.Thread | None = None

    def open(self, hub: str) -> None:
        """Start the process for the hub at the endpoint `hub`; raises ConnectError if listening fails."""
        self._hub = hub
        self._process = self._start()
        self._reader = threading.Thread(target=self._read, name="gate", daemon=True)
        self._reader.start()
        log.info("other machines may join at %s", ", ".join(self.endpoints))

    def _start(self) -> subprocess.Popen[str]:
        command = [sys.executable, "-P", "-m", "hub.security.gate_process"]
        process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True
        )
        orders, answers = _process_pipes(process)
        settings = {
            "listen": self.endpoints,
            "connect": [self._hub],
            "security": self._security,
            "revoked": None if self._revoked is None else str(self._revoked),
        }
        orders.write(json.dumps(settings) + "\n")
        orders.flush()
        answer = answers.readline().strip()
        if answer != OPEN:
            process.communicate()
            raise ConnectError(
                answer or f"the gate at {', '.join(self.endpoints)} ended with exit code {process.returncode}"
            )
        return process

    def _read(self) -> None:
        """Log the reports of the process, and restart an ended process; clients then reconnect."""
        while True:
            answers = _process_pipes(self._process)[1]
            for line in answers:
                level, _, message = line.rstrip().partition(" ")
                log.log(int(level), "gate: %s", message)
            if self._closing.is_set():
                return
            if code := _stop(self._process):
                log.error("the gate ended with exit code %s; restarting it", code)
            else:
                log.warning("the list of revoked certificates has changed: restarting the gate with it")
            answers.close()
            while not self._restart_process():
                if self._closing.wait(_RETRY_S):
                    return

    def _restart_process(self) -> bool:
        with self._starting:
            if self._closing.is_set():
                return False
            try:
                self._process = self._start()
            except ConnectError as error:
                log.error("%s", error)
                return False
            return True

    def close(self) -> None:
        """Stop a started process."""
        if self._reader is None:
            return
        with self._starting:
            self._closing.set()
        _stop(self._process)
        self._reader.join()
        _process_pipes(self._process)[1].close()


def _stop(process: subprocess.Popen[str]) -> int:
    """Stop a process by closing its input, or by force; return the exit code."""
    with suppress(BrokenPipeError):
        _process_pipes(process)[0].close()
    try:
        return process.wait(_STOP_S)
    except subprocess.TimeoutExpired:
        process.kill()
        return process.wait()


def _process_pipes(process: subprocess.Popen[str]) -> tuple[IO[str], IO[str]]:
    """Return the input and the output of a process."""
    if process.stdin is None or process.stdout is None:
        raise ValueError("the process of a gate needs pipes as input and output")
    return process.stdin, process.stdout
