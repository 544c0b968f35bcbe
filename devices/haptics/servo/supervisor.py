"""Keeps a servo process running with every available stylus, and looks for lost styluses.

All styluses of a host are in one process. When a stylus is lost, a process with the rest replaces the
present process: a library may recover in a new process only. A second process beside the first finds out
whether a lost stylus is available again, so no hand loses force meanwhile. The next servo process with the
stylus starts when no hand holds a dead-man.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from devices.haptics.servo.driver import StylusSpec
from devices.haptics.servo.exchange import State
from devices.haptics.servo.phase import ServoPhase
from devices.haptics.servo.probe import Finding, Probe, absence
from devices.haptics.servo.process import DriverChoice, ServoProcess
from schemas.errors import DeviceError

__all__ = ["Lost", "Supervisor"]

log = logging.getLogger(__name__)

_FIRST_RETRY, _LAST_RETRY = 0.25, 4.0
"""After this time (s) a lost stylus is tried again; each time twice as long ..."""
_LASTING = 10.0
"""... until the stylus was available for this long, s."""
_LOADING, _OPENING, _SILENCE = 20.0, 10.0, 1.0
"""Longest times of a process to load the library, until the first frame, and between frames, s."""
_ENDING = 1.0

_STOOD_STILL = "the servo process stood still with force on the hand and was killed, which closes the device"
_NO_PRIORITY = (
    "the servo process has no real-time priority, so the force may falter while the machine is busy: allow it"
    " with the line '@users - rtprio 20' in /etc/security/limits.conf, and log in again"
)


@dataclass
class Lost:
    """Why a stylus is not available."""

    phase: ServoPhase
    code: int
    cause: str
    retry: float
    """Time of the next try, s of time.perf_counter."""
    found: bool = False
    """Whether the stylus is available again, and waits for the next servo process."""


class Supervisor:
    """The servo processes of a device. All methods are for a single thread."""

    def __init__(
        self,
        driver: DriverChoice,
        specs: Mapping[str, StylusSpec],
        opened: Callable[[ServoProcess, dict[str, Any]], None],
    ) -> None:
        """Call `opened` for every open stylus, with the process and the message about the stylus."""
        self._driver, self._specs, self._opened = driver, dict(specs), opened
        self.lost: dict[str, Lost] = {}
        self._process: ServoProcess | None = None
        self._probe: Probe | None = None
        self._started = self._last_frame = 0.0
        self._ending: float | None = None
        self._has_ticked = False
        self._held = dict.fromkeys(specs, False)
        self._delays = dict.fromkeys(specs, _FIRST_RETRY)
        self._warned = False

    @property
    def process(self) -> ServoProcess | None:
        """Present servo process."""
        return self._process

    def start(self, now: float) -> None:
        """Start with all styluses. Raises DeviceError if the driver cannot be loaded."""
        self._start(list(self._specs), now)
        assert self._process
        said = self._process.read_messages(_LOADING)
        if not said or "loaded" not in said[0]:
            self.close()
            options = ", ".join(f"{name} '{value}'" for name, value in self._driver.options.items())
            silent = (
                f"the servo process ends or hangs when it loads the driver {self._driver.driver}"
                f"{f' with {options}' if options else ''}: is that the right library?"
            )
            raise DeviceError(said[0].get("failed", silent) if said else silent)
        for message in said[1:]:
            self._on_message(self._process, message, now)

    def poll(self, now: float) -> dict[str, list[State]]:
        """Supervise the processes; return the new states of each open stylus, oldest first."""
        states: dict[str, list[State]] = {}
        if self._process is not None:
            states = self._attend_process(self._process, now)
        if self._probe is not None and (found := self._probe.poll(now)) is not None:
            self._probe = None
            self._use(found, now)
        self._retry_lost(now)
        return states

    def close(self) -> None:
        """End all processes."""
        for process in (self._process, self._probe):
            if process is not None:
                process.close()
        self._process = self._probe = None

    def _start(self, names: list[str], now: float) -> None:
        self._process = ServoProcess(self._driver, [self._specs[name] for name in names])
        self._started = self._last_frame = now
        self._ending, self._has_ticked = None, False
        self._held = dict.fromkeys(self._specs, False)

    def _attend_process(self, process: ServoProcess, now: float) -> dict[str, list[State]]:
        for message in process.read_messages():
            self._on_message(process, message, now)
        states: dict[str, list[State]] = {}
        for name in process.names:
            new = [State.of(record) for record in process.states[name].read()]
            if not new:
                continue
            self._last_frame, self._has_ticked = now, True
            last = new[-1]
            self._held[name] = bool(last.permitted)
            if ServoPhase(last.phase).is_lost:
                self._lose_stylus(name, ServoPhase(last.phase), last.code, "", now)
                self._end(process, now)
            elif name not in self.lost:
                states[name] = new
        self._check(process, now)
        return states

    def _on_message(self, process: ServoProcess, message: dict[str, Any], now: float) -> None:
        if "absent" in message:
            self._lose_stylus(message["stylus"], *absence(message), "", now)
            if self.lost.keys() >= set(process.names):
                self._end(process, now)
        elif "stylus" in message:
            self._opened(process, message)
        elif "failed" in message:
            for name in process.names:
                self._lose_stylus(name, ServoPhase.FAULT, 0, message["failed"], now)
        elif message.get("priority") == "normal" and not self._warned:
            self._warned = True
            log.warning(_NO_PRIORITY)

    def _check(self, process: ServoProcess, now: float) -> None:
        """Handle the end of a process, and end a hanging process."""
        ended, patience = not process.is_alive, _SILENCE if self._has_ticked else _OPENING
        if not ended and self._ending is None and now - self._last_frame > patience:
            self._end(process, now)
            for name in process.names:
                self._lose_stylus(name, ServoPhase.FAULT, 0, f"no frame for {patience:g} s", now)
        if not ended and self._ending is not None and now - self._ending > _ENDING:
            process.kill()
        if ended:
            process.close()
            if self._ending is None:
                cause = _STOOD_STILL if process.was_killed_by_watcher else "the servo process has ended"
                for name in process.names:
                    self._lose_stylus(name, ServoPhase.FAULT, 0, cause, now)
            self._process = None

    def _end(self, process: ServoProcess, now: float) -> None:
        if self._ending is None:
            self._ending = now
            process.end()

    def _lose_stylus(self, name: str, phase: ServoPhase, code: int, cause: str, now: float) -> None:
        if name in self.lost:
            self.lost[name].cause = self.lost[name].cause or cause
            return
        lasted = now - self._started > _LASTING
        delay = _FIRST_RETRY if lasted else self._delays[name]
        self._delays[name] = min(2.0 * delay, _LAST_RETRY)
        self.lost[name] = Lost(phase, code, cause, now + delay)

    def _retry_lost(self, now: float) -> None:
        """Start the servo process or a probe if a lost stylus is due."""
        due = [
            name
            for name in self._specs
            if name in self.lost and (self.lost[name].found or now >= self.lost[name].retry)
        ]
        if self._process is None and self._probe is None:
            names = [name for name in self._specs if name not in self.lost or name in due]
            if names:
                for name in due:
                    del self.lost[name]
                self._start(names, now)
        elif self._process is not None and self._ending is None and due:
            if any(self.lost[name].found for name in due):
                if not any(self._held.values()):
                    self._end(self._process, now)
            elif self._probe is None:
                self._probe = Probe(ServoProcess(self._driver, [self._specs[name] for name in due]), now)

    def _use(self, found: Mapping[str, Finding | None], now: float) -> None:
        """Use the findings of a probe about lost styluses."""
        for name, finding in found.items():
            lost = self.lost[name]
            if finding is not None and not finding.phase.is_lost:
                lost.found = True
                continue
            if finding is not None:
                lost.phase, lost.code, lost.cause = finding.phase, finding.code, ""
            lost.retry = now + self._delays[name]
            self._delays[name] = min(2.0 * self._delays[name], _LAST_RETRY)
