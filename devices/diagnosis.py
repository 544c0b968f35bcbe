"""The condition of a piece of hardware: each change is published once on an event port, and logged."""

from __future__ import annotations

import logging
from enum import IntEnum

from devices.samples import clock_of
from hub.participant import Sample, event_out
from schemas.ros import DiagnosticStatus

__all__ = ["Diagnosis", "Level"]

log = logging.getLogger(__name__)


class Level(IntEnum):
    """Levels of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


class Diagnosis:
    """The condition of one piece of hardware."""

    def __init__(self, device: str, port: str = "diagnostics", *, simulated_time: bool = False) -> None:
        """Declare the port.

        Args:
            device: the participant's name, and the part of it that has a condition of its own: `touch/right`.
            port: name of the port.
            simulated_time: whether the device lives in simulated time.
        """
        meaning = "each change of the device's condition: what, and what to do"
        clock = clock_of(simulated_time=simulated_time)
        self.port = event_out(port, DiagnosticStatus, meaning, clock=clock)
        self._device = device
        self._last: tuple[Level, str, str] | None = None

    def report(self, level: Level, message: str, hardware: str = "") -> list[Sample]:
        """Return the sample of a change, and log it; nothing if the condition is as reported last.

        Args:
            level: how bad it is.
            message: the condition, and what to do about it.
            hardware: model and serial number, as far as they are known.
        """
        if (level, message, hardware) == self._last:
            return []
        self._last = level, message, hardware
        log.log(
            logging.INFO if level is Level.OK else logging.WARNING, "device '%s': %s", self._device, message
        )
        return [
            Sample(
                self.port.name,
                DiagnosticStatus(level=level, name=self._device, message=message, hardware_id=hardware),
            )
        ]
