"""A second servo process without force, to find out whether lost styluses are available again."""

from __future__ import annotations

from typing import Any, NamedTuple

from devices.haptics.servo.exchange import State
from devices.haptics.servo.phase import ServoPhase
from devices.haptics.servo.process import ServoProcess

__all__ = ["Finding", "Probe", "absence"]

_LOOKING, _ENDING = 10.0, 1.0
"""How long the process may look for the styluses, and then take to end, s."""


class Finding(NamedTuple):
    """The condition of a stylus."""

    phase: ServoPhase
    code: int


class Probe:
    """An attempt to open lost styluses."""

    def __init__(self, process: ServoProcess, now: float) -> None:
        """`process` was started at `now` (s)."""
        self._process, self._until = process, now + _LOOKING
        self._found: dict[str, Finding] = {}

    def poll(self, now: float) -> dict[str, Finding | None] | None:
        """Return the findings, once the process has released the styluses; None before.

        A stylus without finding after the time limit has None.
        """
        process = self._process
        for message in process.read_messages():
            if "absent" in message:
                self._found[message["stylus"]] = absence(message)
        for name, ring in process.states.items():
            for state in map(State.of, ring.read()):
                if state.phase != ServoPhase.SETTLING:
                    self._found[name] = Finding(ServoPhase(state.phase), state.code)
        if self._found.keys() == process.states.keys() or now > self._until:
            process.end()
            self._until = min(self._until, now)
        if now > self._until + _ENDING:
            process.kill()
        if process.is_alive:
            return None
        process.close()
        return {name: self._found.get(name) for name in process.names}

    def close(self) -> None:
        """End the attempt."""
        self._process.close()


def absence(message: dict[str, Any]) -> Finding:
    """Return the condition of an unopened stylus, by the message of the servo process."""
    return Finding(ServoPhase(message["phase"]), message["absent"])
