"""The process of a gate: `python -P -m hub.gate_process`; what it is to do it reads from its input, and it ends when that ends."""

from __future__ import annotations

import json
import logging
import os
import sys
import threading
from time import monotonic
from typing import Any, TextIO

import zenoh

from hub.gate import OPEN
from hub.gate_log import LISTENED_TO, GateLog
from hub.wire import open_session
from schemas.errors import ConnectError

__all__ = ["main"]

_MOST_PER_SECOND = 50


def main() -> None:
    """Keep a gate open until the end of the input; exit code 1 if it cannot be opened."""
    orders: dict[str, Any] = json.loads(sys.stdin.readline())
    answers, zenohs_log = _parted_outputs()
    os.environ["RUST_LOG"] = LISTENED_TO
    zenoh.init_log_from_env_or("error")
    security = orders["security"]
    try:
        session = open_session("router", listen=orders["listen"], connect=orders["connect"], security=security)
    except ConnectError as error:
        answers.write(f"{error}\n")
        sys.exit(1)
    answers.write(f"{OPEN}\n")
    known = [name for subject in security["access_control"]["subjects"] for name in subject.get("cert_common_names", ())]
    threading.Thread(target=_tell, args=(zenohs_log, GateLog(known), answers), name="log", daemon=True).start()
    with session:
        sys.stdin.read()


def _parted_outputs() -> tuple[TextIO, TextIO]:
    """Return the output of this process to write to, and to read what Zenoh believes to write to it: its log always goes there."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w", buffering=1)
    reading, writing = os.pipe()
    os.dup2(writing, sys.stdout.fileno())
    return answers, os.fdopen(reading, encoding="utf-8", errors="replace")


def _tell(zenohs_log: TextIO, gate_log: GateLog, answers: TextIO) -> None:
    """Hand on what is to be told, but not more than so much in a second, whoever knocks at the gate and how often."""
    second, told = 0, 0
    for line in zenohs_log:
        for level, message in gate_log.read(line):
            now = int(monotonic())
            second, told = now, told + 1 if now == second else 1
            if told < _MOST_PER_SECOND:
                answers.write(f"{level} {message}\n")
            elif told == _MOST_PER_SECOND:
                answers.write(f"{logging.WARNING} more is refused in this second than is told\n")


if __name__ == "__main__":
    main()
