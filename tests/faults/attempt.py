"""One attempt: a session, one fault, and a look at how it ended and what it left."""

from __future__ import annotations

import re
import signal
import subprocess
from contextlib import ExitStack
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from time import monotonic, sleep

from hub.recording.recording import Recording
from hub.recording.recover import recover
from hub.transport.session_secret import private_directory
from schemas.errors import RecordingError
from tests.faults.faults import ENGINE, HUB, Fault
from tests.faults.running_session import RunningSession
from tests.faults.traces import remaining

__all__ = ["Result", "attempt"]

ENDS_S = 60.0
"""A process that has not ended after this time hangs."""
OUTLIVES_S = 4.0
"""How long a process may outlive its hub: the kernel kills it at once, unless its interpreter only starts."""

_LINE = re.compile(r"(\d{4}-\d\d-\d\d \d\d:\d\d:\d\d),(\d{3}) (?:ERROR|WARNING) (.*)")


@dataclass
class Result:
    """What became of an attempt."""

    fault: Fault
    named_ms: float | None = None
    """From the fault to the first line in which the hub names the participant."""
    ended_ms: float = 0.0
    """From the fault to the end of the hub."""
    outlived_ms: float = 0.0
    """From the end of the hub to that of the last other process of the session."""
    code: int | None = None
    recording: str = ""
    problems: list[str] = field(default_factory=list[str])
    log: str = ""


def attempt(mark: str, fault: Fault, directory: Path) -> Result:
    """Run a session with `fault` in `directory`, which is empty; its processes have `mark`."""
    result = Result(fault)
    with ExitStack() as stack:
        session = RunningSession(mark, fault, directory, stack)
        try:
            struck = session.strike()
            begun = monotonic()
            if not fault.fails_session and not fault.kills_hub and not session.go_on():
                result.problems.append("the session has not gone on")
            result.code = _wait(session.hub, result)
            result.ended_ms = 1e3 * (monotonic() - begun)
            _watch_the_others(session, result)
        except TimeoutError as error:
            result.problems.append(str(error))
            struck = 0.0
    result.log = "".join(path.read_text(errors="replace") for path in session.logs)
    result.named_ms = _named_ms(result, struck)
    result.recording = _recording(directory / "recording")
    left = [*remaining(session.held), *_temporary(session.temporary, fault)]
    if left:
        result.problems.append(f"left behind: {', '.join(left)}")
    _judge(result)
    return result


def _wait(process: subprocess.Popen[bytes], result: Result) -> int:
    try:
        return process.wait(ENDS_S)
    except subprocess.TimeoutExpired:
        result.problems.append(f"process {process.pid} has not ended within {ENDS_S:g} s")
        process.send_signal(signal.SIGABRT)
        return process.wait()


def _watch_the_others(session: RunningSession, result: Result) -> None:
    """Wait for the end of all processes; that of a remote device outlives its hub, and is ended."""
    begun = monotonic()
    while (others := session.others()) and monotonic() < begun + 2 * OUTLIVES_S:
        result.outlived_ms = 1e3 * (monotonic() - begun)
        if result.outlived_ms > 1e3 * OUTLIVES_S:
            result.problems.append(f"{', '.join(sorted(others))} outlived the hub")
            break
        sleep(0.01)
    if session.remote is not None and session.remote.poll() is None:
        session.remote.terminate()
        # one that only starts ends by the signal itself
        allowed = (0, -signal.SIGTERM) if session.fault.moment == "birth" else (0,)
        if _wait(session.remote, result) not in allowed:
            result.problems.append(f"the remote device ended with exit code {session.remote.returncode}")


def _named_ms(result: Result, struck: float) -> float | None:
    name = "'first'" if result.fault.part == ENGINE else "'hand'"
    for line in result.log.splitlines():
        match = _LINE.match(line)
        if result.fault.is_named and match and name in match[3]:
            second = datetime.strptime(match[1], "%Y-%m-%d %H:%M:%S").timestamp()
            after_ms = 1e3 * (second - struck) + int(match[2])
            if after_ms >= -1.0:  # the log has whole milliseconds
                return after_ms
    return None


def _recording(path: Path) -> str:
    """Return the state of a recording: closed, recovered, or why there is none."""
    if not path.exists():
        return "none"
    try:
        statuses = [status for _, status in Recording(path).statuses()]
        return f"closed, {statuses[-1].state}" if statuses else "closed"
    except RecordingError:
        pass  # it was cut short
    try:
        recovered = Recording(recover(path).path)
        return f"recovered, {sum(1 for _ in recovered.grants())} grants"
    except RecordingError as error:
        return f"none: {error}"


def _temporary(directory: Path, fault: Fault) -> list[str]:
    """Return what is left of temporary files; a hub that is killed leaves the secret of its session."""
    private = private_directory().name
    found = (path.relative_to(directory) for path in directory.rglob("*"))
    return [
        str(path)
        for path in found
        if path.parts != (private,) and (path.parts[0] != private or not fault.kills_hub)
    ]


def _judge(result: Result) -> None:
    """Add what is not as it must be."""
    fault, problems = result.fault, result.problems
    problems += [f"a {word}" for word in ("Traceback", "panicked") if word in result.log]
    if fault.is_named and result.named_ms is None:
        problems.append("the part is not named")
    codes = (-signal.SIGKILL,) if fault.kills_hub else (1,)
    if fault.moment == "close":
        codes = (-signal.SIGKILL, 0, 1) if fault.part == HUB else (0, 1)
    if result.code not in codes:
        problems.append(f"exit code {result.code} instead of {' or '.join(str(int(code)) for code in codes)}")
    whole = result.recording.startswith("closed")
    if not whole and not (fault.kills_hub and result.recording.startswith("recovered")):
        problems.append(f"recording: {result.recording}")
