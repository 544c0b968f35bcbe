"""One attempt: a session in processes, one fault at a random moment, and a look at what it left."""

from __future__ import annotations

import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from time import monotonic, sleep, time

from hub.recording.recording import Recording
from hub.recording.recover import recover
from hub.transport.endpoints import address
from schemas.errors import RecordingError
from tests.devices.standins import build
from tests.devices.standins.hd import VARIABLE, HdWorld
from tests.faults.traces import MARK, Process, abstract_sockets, lanes, living, segments
from tests.hub.authorities import free_endpoint
from tests.hub.proxy import Proxy

__all__ = ["Fault", "Result", "attempt", "fault_of"]

HERE = Path(__file__).parent
ENDS_S = 30.0
"""A session that has not ended this long after a fault hangs: more than all limits of the scenario."""
OUTLIVES_S = 1.0
"""How long the last process of a session may outlive its hub."""
LONG_STEP_MS = 3000
ENGINES, DEVICE, REMOTE = ("host one",), "host hand", "device hand"
LIBRARY = Path(tempfile.gettempdir()) / f"trocar-standin-{os.getpid()}.so"


@dataclass(frozen=True)
class Fault:
    """What is done to which part, and when."""

    part: str
    action: str
    """`kill`; `stop` for good; `pause`, which is a stop of `pause_s`; `cut` and `choke` of the network link."""
    moment: str
    """`birth`: `delay_s` after the part's process was made; `run`: after the first step; `close`: after the
    session was requested to end.
    """
    delay_s: float
    pause_s: float = 0.0
    long_step: bool = False
    """The engine's host computes for LONG_STEP_MS when it happens, and keeps the interpreter lock."""
    stopped: bool = False
    """The engine's host is stopped when the hub is killed."""

    def __str__(self) -> str:
        long = ", in a long step" if self.long_step else ""
        stopped = ", with its host stopped" if self.stopped else ""
        return f"{self.action} {self.part}, {self.moment} + {1e3 * self.delay_s:.0f} ms{long}{stopped}"

    @property
    def ends_session(self) -> bool:
        """Whether the session must end by itself, with a failure."""
        if self.moment == "close" or self.action == "pause":
            return False
        return self.part == "hub" or (
            self.part in (*ENGINES, DEVICE) and (self.action == "kill" or self.part != DEVICE)
        )

    @property
    def is_named(self) -> bool:
        """Whether the hub must say what has happened."""
        if self.moment == "close" or self.part == "hub":
            return False
        return self.ends_session or (self.part == REMOTE and self.action == "kill") or self.action == "cut"


@dataclass
class Result:
    """What became of an attempt."""

    fault: Fault
    named_ms: float | None = None
    outlived_ms: float = 0.0
    """How long the last other process of the session lived after its hub."""
    code: int | None = None
    recording: str = ""
    problems: list[str] = field(default_factory=list[str])
    log: str = ""


def fault_of(source: random.Random) -> Fault:
    """Return a fault at random."""
    part = source.choice(
        ["hub", "hub", "hub", *ENGINES * 3, DEVICE, DEVICE, REMOTE, "servo", "watcher", "link"]
    )
    if not build.USABLE and part in ("servo", "watcher"):
        part = DEVICE
    moment = source.choice(["birth", "run", "run", "close"])
    if part == "link":
        moment = "run"
    longest_s = {"birth": 0.9, "run": 0.3, "close": 0.25}[moment]
    actions = {"link": ["cut", "choke"], "servo": ["kill"], "watcher": ["kill"]}
    action = source.choice(actions.get(part, ["kill", "kill", "kill", "stop", "pause"]))
    if action == "stop" and part in (DEVICE, REMOTE):
        action = "pause"
    long_step = part in ("hub", "host one") and moment == "run" and source.random() < 0.25
    stopped = (
        part == "hub" and action == "kill" and moment != "close" and not long_step and source.random() < 0.3
    )
    pause_s = 0.05 + 0.25 * source.random()
    return Fault(part, action, moment, source.random() * longest_s, pause_s, long_step, stopped)


def attempt(mark: str, fault: Fault, directory: Path) -> Result:
    """Run a session with `fault` in `directory`, which is empty, and return what became of it."""
    result = Result(fault)
    memory = segments()
    with ExitStack() as stack:
        running = Running(mark, fault, directory, stack)
        began = running.strike()
        running.end(result)
    log = result.log = "".join(path.read_text(errors="replace") for path in running.logs)
    result.named_ms = _named_ms(fault, log, began)
    result.recording = _recording(directory, result, mark)
    left = [name for name in os.listdir(directory / "tmp")]
    _judge(result, [*running.left_behind(), *sorted(segments() - memory), *left])
    return result


class Running:
    """The processes of an attempt; what they print goes to files."""

    def __init__(self, mark: str, fault: Fault, directory: Path, stack: ExitStack) -> None:
        self.mark, self.fault, self.directory, self._stack = mark, fault, directory, stack
        (directory / "tmp").mkdir()
        self.logs: list[Path] = []
        self._environment = {
            **os.environ,
            MARK: mark,
            "PYTHONFAULTHANDLER": "1",
            "TMPDIR": str(directory / "tmp"),
            "PYTHONPATH": os.pathsep.join((str(HERE), str(HERE.parents[1]))),
        }
        self.lanes: set[str] = set()
        self.endpoint = free_endpoint()
        self._far: subprocess.Popen[bytes] | None = None
        self._proxy: Proxy | None = None
        scenario = directory / "faults.json"
        scenario.write_text(json.dumps(self._scenario()))
        stack.callback(self._kill_all)
        record = str(directory / "recording")
        self.hub = self._start("run", str(scenario), "--listen", self.endpoint, "--record", record)
        if self._with_remote:
            self._proxy = stack.enter_context(Proxy(address(self.endpoint)[1]))
            self._far = self._start("device", "hand", "--connect", f"tcp/127.0.0.1:{self._proxy.port}")

    @property
    def _with_remote(self) -> bool:
        return self.fault.part in (REMOTE, "link")

    @property
    def _with_hand(self) -> bool:
        return self.fault.part not in ENGINES and not self.fault.long_step

    def _scenario(self) -> dict[str, object]:
        """Return the scenario; a part that only some faults concern is only there for them."""
        long_step = {"long_step": 20, "long_step_ms": LONG_STEP_MS} if self.fault.long_step else {}
        engine, running = {"kind": "fault_parts:Engine"}, str(self.directory / "running")
        participants: dict[str, object] = {
            "first": {**engine, "host": "one", "configure_ms": 150, **long_step},
            "last": {**engine, "seed": 2, "hand": self._with_hand, "running": running},
        }
        connections = ["first.out -> last.a"]
        if self.fault.part in ("servo", "watcher", DEVICE) and LIBRARY.exists():
            self._environment[VARIABLE] = str(HdWorld(LIBRARY, self.directory / "world").file)
            participants["hand"] = {
                "kind": "touch",
                "host": "hand",
                "library": str(LIBRARY),
                "styluses": {"right": {}},
            }
            connections.append("hand.right/pose -> last.hand")
        elif self._with_hand:
            host = "remote" if self._with_remote else "hand"
            participants["hand"] = {"kind": "fault_parts:Hand", "host": host}
            connections.append("hand.pose -> last.hand")
        return {
            "name": "faults",
            "step": "2 ms",
            "pace": "realtime",
            "answer_limit": "1 s" if self.fault.action == "stop" else "10 s",
            "participants": participants,
            "connections": connections,
        }

    def _start(self, *arguments: str) -> subprocess.Popen[bytes]:
        log = self.directory / f"{len(self.logs)}.log"
        self.logs.append(log)
        with log.open("wb") as stream:
            command = [sys.executable, "-P", "-m", "hub.command_line", *arguments]
            return subprocess.Popen(
                command, stdout=stream, stderr=stream, env=self._environment, cwd=self.directory
            )

    def strike(self) -> float:
        """Wait for the moment of the fault, do it, and return when that was (s of the wall clock)."""
        fault = self.fault
        if fault.moment != "birth":
            self._until((self.directory / "running").exists, "the first step")
        process = None if fault.part == "link" else self._until(lambda: self._find(fault.part), fault.part)
        if fault.part == "hub" and fault.moment == "birth":  # of its first host: before, there is no session
            self._until(lambda: self._find(ENGINES[0]), ENGINES[0])
        if fault.moment == "close":
            self.hub.terminate()
        sleep(fault.delay_s)
        self.lanes |= lanes(living(self.mark))
        host = self._find(ENGINES[0]) if fault.stopped else None
        if host is not None:
            os.kill(host.pid, signal.SIGSTOP)
        began = time()
        if process is not None:
            self._send(process, fault)
        elif self._proxy is not None:
            self._proxy.cut() if fault.action == "cut" else self._proxy.hold()
            sleep(fault.pause_s)
            self._proxy.go_on()
        return began

    def _find(self, part: str) -> Process | None:
        if part == "hub":
            return Process(self.hub.pid, [], 0)
        return living(self.mark).get(part)

    def _send(self, process: Process, fault: Fault) -> None:
        with suppress(ProcessLookupError):
            os.kill(process.pid, signal.SIGKILL if fault.action == "kill" else signal.SIGSTOP)
            if fault.action == "pause":
                sleep(fault.pause_s)
                os.kill(process.pid, signal.SIGCONT)
            elif fault.action == "stop" and fault.part == "hub":
                sleep(fault.pause_s)
                os.kill(process.pid, signal.SIGKILL)

    def end(self, result: Result) -> None:
        """Let the session end, or end it, and watch how long its processes outlive the hub."""
        if self.fault.ends_session:
            self._wait(self.hub, result)
        else:
            self._survive(result)
        began = monotonic()
        others = lambda: {part for part in living(self.mark) if part != REMOTE}  # noqa: E731
        while (rest := others()) and monotonic() < began + ENDS_S:
            result.outlived_ms = 1e3 * (monotonic() - began)
            last = rest
            sleep(0.01)
        if result.outlived_ms > 1e3 * OUTLIVES_S:
            result.problems.append(
                f"{', '.join(sorted(last))} outlived the hub by {result.outlived_ms:.0f} ms"
            )
        if self._far is not None and self._far.poll() is None:
            self._far.terminate()
            if self._wait(self._far, result) != 0:
                result.problems.append(f"the remote device ended with exit code {self._far.returncode}")

    def _survive(self, result: Result) -> None:
        """Look whether the session goes on after the fault; then end it."""
        if self.fault.moment != "close":
            self._until((self.directory / "running").exists, "the first step after the fault")
            sleep(0.2)
            if self.hub.poll() is not None:
                result.problems.append("the session has not outlived the fault")
            self.hub.terminate()
        self._wait(self.hub, result)

    def _wait(self, process: subprocess.Popen[bytes], result: Result) -> int | None:
        try:
            code = process.wait(ENDS_S)
        except subprocess.TimeoutExpired:
            result.problems.append(f"process {process.pid} has not ended within {ENDS_S:g} s")
            process.send_signal(signal.SIGABRT)  # which prints where it hangs
            code = process.wait()
        if process is self.hub:
            result.code = code
        return code

    def left_behind(self) -> list[str]:
        """Return the abstract sockets of the session that are still there."""
        return sorted(self.lanes & abstract_sockets())

    def _kill_all(self) -> None:
        for _ in range(3):
            for process in living(self.mark).values():
                with suppress(ProcessLookupError):
                    os.kill(process.pid, signal.SIGKILL)
        for process in (self.hub, self._far):
            if process is not None:
                process.kill()
                process.wait()

    def _until(self, look: Callable[[], object], what: str, limit_s: float = 90.0):
        deadline = monotonic() + limit_s
        while not (found := look()):
            if monotonic() > deadline or (self.hub.poll() is not None):
                raise TimeoutError(
                    f"{self.fault}: waited for {what}\n" + "".join(p.read_text() for p in self.logs)
                )
            sleep(0.002)
        return found


def _named_ms(fault: Fault, log: str, began: float) -> float | None:
    """Return how long after the fault the hub has named the part, by the time of its log line."""
    names = {"host one": "first"}.get(fault.part, "hand")
    for line in log.splitlines():
        match = re.match(
            r"(\d{4}-\d\d-\d\d \d\d:\d\d:\d\d),(\d{3}) (?:ERROR|WARNING) .*'" + names + "'", line
        )
        if match:
            at = datetime.strptime(match[1], "%Y-%m-%d %H:%M:%S").timestamp() + int(match[2]) / 1e3
            if at >= began - 0.001:
                return 1e3 * (at - began)
    return None


def _recording(directory: Path, result: Result, mark: str) -> str:
    """Return the state of the recording: `closed`, `recovered`, or `none` if it had not begun."""
    path = directory / "recording"
    if not path.exists():
        return "none"
    try:
        statuses = list(Recording(path).statuses())
        return f"closed, {statuses[-1][1].state}" if statuses else "closed"
    except RecordingError:
        pass
    try:
        saved = recover(path)
        grants = sum(1 for _ in Recording(saved.path).grants())
    except RecordingError as error:
        return f"none: {error}"
    return f"recovered, {grants} grants"


def _judge(result: Result, left: list[str]) -> None:
    fault, problems = result.fault, result.problems
    if left:
        problems.append(f"left behind: {', '.join(left)}")
    if "Traceback" in result.log:
        problems.append("a traceback")
    if "panicked" in result.log:
        problems.append("a panic")
    if fault.is_named and result.named_ms is None:
        problems.append("not named")
    wanted: tuple[int, ...] = (-9,) if fault.part == "hub" and fault.action != "pause" else (1,)
    if fault.moment == "close":
        wanted = (-9, 0, 1) if fault.part == "hub" else (0, 1)
    if result.code not in wanted:
        problems.append(f"exit code {result.code}, expected {' or '.join(map(str, wanted))}")
    killed = fault.part == "hub" and fault.action != "pause"
    if not killed and not result.recording.startswith("closed"):
        problems.append(f"recording: {result.recording}")
    elif killed and fault.moment == "run" and result.recording.startswith("none"):
        problems.append(f"recording: {result.recording}")
