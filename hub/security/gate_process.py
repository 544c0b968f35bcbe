"""The process of a gate: `python -P -m hub.security.gate_process`; what it is to do it reads from its input,
and it ends when that ends.
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
from time import monotonic
from typing import Any, TextIO

import zenoh

from hub.security.closed_connections import ended_connections
from hub.security.gate import OPEN
from hub.security.gate_log import LISTENED_TO, GateLog
from hub.transport.endpoints import address
from hub.transport.zenoh_session import open_session
from schemas.errors import ConnectError

__all__ = ["main"]

_MOST_PER_SECOND = 200
"""So much is told of whoever knocks, however often."""

_LATER_S = 0.3
"""That a connection has ended may be known before the line of the log is read which says that it was let in.
"""


def main() -> None:
    """Keep a gate open until the end of the input; exit code 1 if it cannot be opened."""
    orders: dict[str, Any] = json.loads(sys.stdin.readline())
    answers, zenohs_log = _parted_outputs()
    os.environ["RUST_LOG"] = LISTENED_TO
    zenoh.init_log_from_env_or("error")
    security = orders["security"]
    try:
        session = open_session(
            "router", listen=orders["listen"], connect=orders["connect"], security=security
        )
    except ConnectError as error:
        answers.write(f"{error}\n")
        sys.exit(1)
    answers.write(f"{OPEN}\n")
    known = [
        name
        for subject in security["access_control"]["subjects"]
        for name in subject.get("cert_common_names", ())
    ]
    gate_log, tell = GateLog(known), _Telling(answers)
    ports = {address(endpoint)[1] for endpoint in orders["listen"]}
    for task in (lambda: _read(zenohs_log, gate_log, tell), lambda: _look(ports, gate_log, tell)):
        threading.Thread(target=task, daemon=True).start()
    with session:
        sys.stdin.read()


def _parted_outputs() -> tuple[TextIO, TextIO]:
    """Return the output of this process to write to, and to read what Zenoh believes to write to it: its log
    always goes there.
    """
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w", buffering=1)
    reading, writing = os.pipe()
    os.dup2(writing, sys.stdout.fileno())
    return answers, os.fdopen(reading, encoding="utf-8", errors="replace")


class _Telling:
    """Tells the hub, but not more than so much in a second."""

    def __init__(self, answers: TextIO) -> None:
        self._answers = answers
        self._lock = threading.Lock()
        self._second = self._count = 0

    def __call__(self, told: Iterable[tuple[int, str]]) -> None:
        for level, message in told:
            with self._lock:
                now = int(monotonic())
                self._second, self._count = now, self._count + 1 if now == self._second else 1
                if self._count < _MOST_PER_SECOND:
                    self._answers.write(f"{level} {message}\n")
                elif self._count == _MOST_PER_SECOND:
                    self._answers.write(f"{logging.WARNING} there is more in this second than is told\n")


_Tell = Callable[[Iterable[tuple[int, str]]], None]


def _read(zenohs_log: TextIO, gate_log: GateLog, tell: _Tell) -> None:
    for line in zenohs_log:
        tell(gate_log.read(line))


def _look(ports: set[int], gate_log: GateLog, tell: _Tell) -> None:
    ended: deque[tuple[float, str]] = deque()
    with suppress(OSError, AttributeError):  # a system that does not tell it; one without such sockets
        for other in ended_connections(ports, _LATER_S):
            if other is not None:
                ended.append((monotonic() + _LATER_S, other))
            while ended and ended[0][0] <= monotonic():
                tell(gate_log.ended(ended.popleft()[1]))


if __name__ == "__main__":
    main()
