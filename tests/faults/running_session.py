"""A session in processes of its own, which a fault hits."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from time import monotonic, sleep, time
from typing import TypeVar

from hub.transport.endpoints import address
from hub.transport.session_secret import private_directory
from tests.devices.standins.hd import VARIABLE, HdWorld
from tests.faults.faults import DEVICE, ENGINE, GATE, HUB, LINK, REMOTE, SERVO, WATCHER, Fault
from tests.faults.traces import MARK, Process, held, living
from tests.hub.authorities import Authority, free_endpoint, free_port
from tests.hub.proxy import Proxy

__all__ = ["LIBRARY", "RunningSession"]

LIBRARY = Path(tempfile.gettempdir()) / f"trocar-standin-{os.getpid()}.so"
"""The stand-in of HDAPI, if it is compiled: then the device is a haptic one."""

LONG_STEP_MS = 10_000
_PATIENCE_S = 120.0
"""For what takes a second on a machine that has time for it."""

T = TypeVar("T")


class RunningSession:
    """A hub, a host with an engine, and what a fault concerns: a device, a gate. `stack` ends all of them."""

    def __init__(self, mark: str, fault: Fault, directory: Path, stack: ExitStack) -> None:
        self.mark, self.fault, self._directory = mark, fault, directory
        self.logs: list[Path] = []
        self.held: set[str] = set()
        """What the processes had when the fault came."""
        self.temporary = directory / "temporary"
        self.temporary.mkdir()
        here = Path(__file__).parent
        self._environment = {
            **os.environ,
            MARK: mark,
            "TMPDIR": str(self.temporary),
            "PYTHONPATH": os.pathsep.join((str(here), str(here.parents[1]))),
            "PYTHONFAULTHANDLER": "1",  # a process that hangs prints where, when it is aborted
        }
        self._running = directory / "running"
        self._proxy: Proxy | None = None
        self.remote: subprocess.Popen[bytes] | None = None
        stack.callback(self._kill_all)
        endpoint = free_endpoint()
        self.hub = self._start("run", *self._scenario(), *self._gate(), "--listen", endpoint)
        if fault.concerns(REMOTE, LINK):
            self._until(lambda: self._find(ENGINE))  # the hub listens
            secrets = self.temporary / private_directory().name
            self._proxy = stack.enter_context(Proxy(address(endpoint)[1], secrets))
            self.remote = self._start("device", "hand", "--connect", f"tcp/127.0.0.1:{self._proxy.port}")

    def _scenario(self) -> list[str]:
        """Write the scenario; return the arguments with which the hub runs and records it."""
        fault, device = self.fault, {"kind": "fault_parts:Hand", "host": "hand"}
        long_step = {"long_step": 20, "long_step_ms": LONG_STEP_MS} if fault.long_step else {}
        engine, port = {"kind": "fault_parts:Engine"}, "pose"
        if fault.concerns(REMOTE, LINK):
            device["host"] = "remote"
        elif fault.part in (SERVO, WATCHER, DEVICE) and LIBRARY.exists():
            self._environment[VARIABLE] = str(HdWorld(LIBRARY, self._directory / "world").file)
            device |= {"kind": "touch", "library": str(LIBRARY), "styluses": {"right": {}}}
            port = "right/pose"
        with_hand = fault.part not in (ENGINE, GATE) and not fault.long_step
        scenario = {
            "name": "faults",
            "step": "2 ms",
            "pace": "realtime",
            "answer_limit": "3 s" if fault.action == "stop" else "60 s",
            "join_limit": "20 s" if fault.action == "stop" or fault.may_not_join else "60 s",
            "participants": {
                "first": {**engine, "host": "one", "configure_ms": 150, **long_step},
                "last": {**engine, "seed": 2, "hand": with_hand, "running": str(self._running)},
                **({"hand": device} if with_hand else {}),
            },
            "connections": ["first.out -> last.a", *([f"hand.{port} -> last.hand"] if with_hand else [])],
        }
        file = self._directory / "faults.json"
        file.write_text(json.dumps(scenario))
        return [str(file), "--record", str(self._directory / "recording")]

    def _gate(self) -> list[str]:
        if not self.fault.concerns(GATE):
            return []
        certificates = Authority.founded(self._directory / "certificates").directory
        return ["--listen", f"tls/127.0.0.1:{free_port()}", "--certs", str(certificates)]

    def _start(self, *arguments: str) -> subprocess.Popen[bytes]:
        log = self._directory / f"{len(self.logs)}.log"
        self.logs.append(log)
        with log.open("wb") as stream:
            command = [sys.executable, "-P", "-m", "hub.command_line", *arguments]
            return subprocess.Popen(
                command, stdout=stream, stderr=stream, env=self._environment, cwd=self._directory
            )

    def strike(self) -> float:
        """Wait for the moment of the fault, let it happen, and return when that was, s of the wall clock."""
        fault = self.fault
        born = {"servo": SERVO, "birth": ENGINE if fault.part == HUB else fault.part}.get(fault.moment)
        if born is None:
            self._until(self._running.exists)
        else:
            self._until(lambda: self._find(born))
        target = None if fault.part == LINK else self._until(lambda: self._find(fault.part))
        if fault.moment == "close":
            self.hub.terminate()
        sleep(fault.delay_s)
        self.held = held(self.mark)
        if fault.stopped:
            self._signal(self._find(ENGINE), signal.SIGSTOP)
        began = time()
        if target is None:
            self._disturb_link()
        else:
            self._hit(target)
        return began

    def _hit(self, target: Process) -> None:
        fault = self.fault
        if fault.action == "kill":
            self._signal(target, signal.SIGKILL)
            return
        self._signal(target, signal.SIGSTOP)
        if fault.action == "pause" or fault.kills_hub:
            sleep(fault.pause_s)
            self._signal(target, signal.SIGCONT if fault.action == "pause" else signal.SIGKILL)

    def _disturb_link(self) -> None:
        assert self._proxy is not None
        if self.fault.action == "cut":
            self._proxy.cut()
        else:
            self._proxy.hold()
        sleep(self.fault.pause_s)
        self._proxy.go_on()

    def go_on(self) -> bool:
        """Let the session go on for a moment, and end it; return whether it went on."""
        if self.fault.moment == "close":
            return True  # it ends already
        self._until(lambda: self._running.exists() or self._given_up())
        if self._given_up():
            return True  # it has not gone on, and says why
        if self.fault.is_named:
            self._until(lambda: "'hand' is gone" in self.logs[0].read_text(errors="replace"))
        sleep(0.2)
        went_on = self.hub.poll() is None
        self.hub.terminate()
        return went_on

    def _given_up(self) -> bool:
        """Return whether the hub ends because what was killed did not join, or cannot be opened."""
        log = self.logs[0].read_text(errors="replace") if self.fault.may_prevent_start else ""
        return "did not join within" in log or "cannot be opened" in log

    def others(self) -> set[str]:
        """Return the parts that must end with the hub and live."""
        return {process.part for process in living(self.mark)} - {REMOTE}

    def _find(self, part: str) -> Process | None:
        if part == HUB:
            return Process(self.hub.pid, ())
        return next((process for process in living(self.mark) if process.part == part), None)

    def _signal(self, process: Process | None, number: signal.Signals) -> None:
        with suppress(ProcessLookupError):
            if process is not None:
                os.kill(process.pid, number)

    def _until(self, look: Callable[[], T]) -> T:
        """Wait until `look` finds something; raise TimeoutError if the hub ends before."""
        deadline = monotonic() + _PATIENCE_S
        while not (found := look()):
            if monotonic() > deadline or self.hub.poll() is not None:
                raise TimeoutError(f"the session has ended or hangs before: {self.fault}")
            sleep(0.002)
        return found

    def _kill_all(self) -> None:
        for process in living(self.mark):
            self._signal(process, signal.SIGKILL)
        for started in (self.hub, self.remote):
            if started is not None:
                started.wait()
