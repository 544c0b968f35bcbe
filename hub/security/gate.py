"""The gate of a hub: the one process that listens to other machines (docs/decisions/0027-remote-hosts.md).

It shows them the hub's certificate, demands theirs and holds them to the access rules. What it lets through
goes to the hub's router over loopback; what it refuses, it tells the hub, which logs it.
"""

from __future__ import annotations

import json
import logging
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import IO, Any

from schemas.errors import ConnectError

__all__ = ["OPEN", "Gate"]

log = logging.getLogger(__name__)

OPEN = "open"
"""What the process says once it listens."""

_END_S = 3.0
_AGAIN_S = 1.0


class Gate:
    """The gate as its hub has it."""

    def __init__(self, endpoints: Sequence[str], security: Mapping[str, Any]) -> None:
        """`endpoints`: where to listen, such as tls/0.0.0.0:7447; `security`: Zenoh's settings of TLS and of
        access.
        """
        self.endpoints = list(endpoints)
        self._security = dict(security)
        self._closing = threading.Event()
        self._starting = threading.Lock()
        self._reader: threading.Thread | None = None

    def open(self, hub: str) -> None:
        """Start the process, before the hub that listens at `hub`; raises ConnectError if it cannot listen."""
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
        orders, answers = _ends(process)
        orders.write(
            json.dumps({"listen": self.endpoints, "connect": [self._hub], "security": self._security}) + "\n"
        )
        orders.flush()
        answer = answers.readline().strip()
        if answer != OPEN:
            process.communicate()
            raise ConnectError(
                answer or f"the gate at {', '.join(self.endpoints)} ended with exit code {process.returncode}"
            )
        return process

    def _read(self) -> None:
        """Log what the process tells; start it again if it ends by itself: its clients come back by
        themselves.
        """
        while True:
            answers = _ends(self._process)[1]
            for line in answers:
                level, _, message = line.rstrip().partition(" ")
                log.log(int(level), "gate: %s", message)
            if self._closing.is_set():
                return
            log.error("the gate ended with exit code %s; opening it again", _end(self._process))
            answers.close()
            while not self._start_again():
                if self._closing.wait(_AGAIN_S):
                    return

    def _start_again(self) -> bool:
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
        """End the process, if it was started: with its input, or by force."""
        if self._reader is None:
            return
        with self._starting:
            self._closing.set()
        _end(self._process)
        self._reader.join()
        _ends(self._process)[1].close()


def _end(process: subprocess.Popen[str]) -> int:
    """End a process, with its input or by force; return its exit code."""
    with suppress(BrokenPipeError):
        _ends(process)[0].close()
    try:
        return process.wait(_END_S)
    except subprocess.TimeoutExpired:
        process.kill()
        return process.wait()


def _ends(process: subprocess.Popen[str]) -> tuple[IO[str], IO[str]]:
    """Return where to write to a process and where to read what it writes."""
    if process.stdin is None or process.stdout is None:
        raise ValueError("a gate is started with pipes at both ends")
    return process.stdin, process.stdout
