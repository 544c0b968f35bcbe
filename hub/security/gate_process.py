"""The process of a gate, `python -P -m hub.security.gate_process`.

The process reads settings from the first line of its input, and ends when the input is closed, or when the
list of revoked certificates changes: started again, the process has new rules and new connections.
"""

from __future__ import annotations

import json
import logging
import os
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from time import monotonic
from typing import Any, TextIO

import zenoh

from hub.security import revoked
from hub.security.closed_connections import closed_connections
from hub.security.gate import OPEN
from hub.security.gate_log import LOG_FILTER, GateLog
from hub.transport.endpoints import address
from hub.transport.zenoh_session import open_session
from schemas.errors import ConnectError

__all__ = ["main"]

_MOST_PER_SECOND = 200
"""Most lines reported to the hub per second, however often clients try to connect."""

_LATER_S = 0.3
"""Delay of the report of a closed connection: the log line of its acceptance may come later."""

_LIST_S = 1.0
"""How often the list of revoked certificates is read."""


def main() -> None:
    """Run a gate until its end; exit code 1 if listening fails."""
    first = sys.stdin.readline()
    if not first:  # the hub has ended before it could send it
        sys.exit(1)
    orders: dict[str, Any] = json.loads(first)
    answers, zenohs_log = _split_outputs()
    os.environ["RUST_LOG"] = LOG_FILTER
    zenoh.init_log_from_env_or("error")
    security = orders["security"]
    file = orders["revoked"] and Path(orders["revoked"])
    try:
        banned = _revoked(file)
        known = _accept_others(security, banned)
        session = open_session(
            "router", listen=orders["listen"], connect=orders["connect"], security=security
        )
    except ConnectError as error:
        answers.write(f"{error}\n")
        sys.exit(1)
    answers.write(f"{OPEN}\n")
    gate_log, report = GateLog(known, banned), _Reporter(answers)
    ports = {address(endpoint)[1] for endpoint in orders["listen"]}
    for task in (lambda: _read(zenohs_log, gate_log, report), lambda: _watch(ports, gate_log, report)):
        threading.Thread(target=task, daemon=True).start()
    with session:
        _wait_for_end(file, banned)


def _revoked(file: Path | None) -> list[str]:
    return [] if file is None else revoked.read(file)


def _accept_others(security: dict[str, Any], banned: list[str]) -> list[str]:
    """Apply the rules of each name to its valid certificates; return the certificates' common names."""
    known: list[str] = []
    for subject in security["access_control"]["subjects"]:
        if names := subject.get("cert_common_names"):
            subject["cert_common_names"] = [revoked.common_name(name, banned) for name in names]
            known += subject["cert_common_names"]
    return known


def _wait_for_end(file: Path | None, banned: list[str]) -> None:
    """Return when the input is closed, or the list of revoked certificates differs from `banned`."""
    closed = threading.Event()

    def wait_for_close() -> None:
        while os.read(sys.stdin.fileno(), 1024):
            pass
        closed.set()

    threading.Thread(target=wait_for_close, daemon=True).start()
    while not closed.wait(_LIST_S):
        try:
            if _revoked(file) != banned:
                return
        except ConnectError:  # no list, no gate: the next process says why
            return


def _split_outputs() -> tuple[TextIO, TextIO]:
    """Return this process' output, and a pipe with the log of Zenoh, otherwise written to the output."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w", buffering=1)
    reading, writing = os.pipe()
    os.dup2(writing, sys.stdout.fileno())
    return answers, os.fdopen(reading, encoding="utf-8", errors="replace")


class _Reporter:
    """Reports to the hub, at most `_MOST_PER_SECOND` lines in a second."""

    def __init__(self, answers: TextIO) -> None:
        self._answers = answers
        self._lock = threading.Lock()
        self._second = self._count = 0

    def __call__(self, reports: Iterable[tuple[int, str]]) -> None:
        for level, message in reports:
            with self._lock:
                now = int(monotonic())
                self._second, self._count = now, self._count + 1 if now == self._second else 1
                if self._count == _MOST_PER_SECOND:
                    level, message = logging.WARNING, "more reports in this second are left out"
                if self._count <= _MOST_PER_SECOND:
                    with suppress(BrokenPipeError):  # the hub is gone, and this process ends with its input
                        self._answers.write(f"{level} {message}\n")


_Report = Callable[[Iterable[tuple[int, str]]], None]


def _read(zenohs_log: TextIO, gate_log: GateLog, report: _Report) -> None:
    for line in zenohs_log:
        report(gate_log.read(line))


def _watch(ports: set[int], gate_log: GateLog, report: _Report) -> None:
    closed: deque[tuple[float, str]] = deque()
    with suppress(OSError, AttributeError):  # a system that does not report it, or without such sockets
        for other in closed_connections(ports, _LATER_S):
            if other is not None:
                closed.append((monotonic() + _LATER_S, other))
            while closed and closed[0][0] <= monotonic():
                report(gate_log.closed(closed.popleft()[1]))


if __name__ == "__main__":
    main()
