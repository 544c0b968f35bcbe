"""A second servo process, which finds out whether styluses that were lost can be had again. It gives no force."""

from __future__ import annotations

from devices.openhaptics.exchange import State
from devices.openhaptics.process import ServoProcess
from devices.openhaptics.stylus import Phase

__all__ = ["Probe"]

_LOOKING, _ENDING = 10.0, 1.0
"""How long the process may look for the styluses, and then take to end, s."""


class Probe:
    """One try."""

    def __init__(self, process: ServoProcess, now: float) -> None:
        """Take a process that was started at `now` (s)."""
        self._process, self._until = process, now + _LOOKING
        self._found: dict[str, bool] = {}

    def poll(self, now: float) -> dict[str, bool] | None:
        """Return which styluses can be had, once that is known and the process has let go of them; before that None."""
        process = self._process
        for message in process.said():
            if "absent" in message:
                self._found[message["stylus"]] = False
        for name, ring in process.states.items():
            for record in ring.read():
                phase = Phase(State.of(record).phase)
                if phase.is_lost or phase is not Phase.SETTLING:
                    self._found[name] = not phase.is_lost
        if self._found.keys() == process.states.keys() or now > self._until:
            process.end()
            self._until = min(self._until, now)
        if now > self._until + _ENDING:
            process.kill()
        if process.is_alive:
            return None
        process.close()
        return {name: self._found.get(name, False) for name in process.names}

    def close(self) -> None:
        """End the try."""
        self._process.close()
