"""What a piece of hardware has to say of itself: each change of its condition once, on an event port and in
the log.
"""

from __future__ import annotations

import logging
from enum import IntEnum
from typing import Literal

from hub.participant import Sample
from schemas.ports import Port
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

    def __init__(
        self, device: str, port: str = "diagnostics", *, clock: Literal["simulated", "wall"] = "wall"
    ) -> None:
        """Take the participant's name, followed by the part of it that has a condition of its own:
        `touch/right`.
        """
        said = "each change of the device's condition: what, and what to do"
        self.port = Port(
            name=port,
            causality="output",
            type=DiagnosticStatus.ros_type,
            variability="event",
            clock=clock,
            description=said,
        )
        self._device = device
        self._last: tuple[Level, str, str] | None = None

    def tell(self, level: Level, message: str, hardware: str = "") -> list[Sample]:
        """Return the sample that tells of a change, and log it; nothing if this was the last thing told.

        Args:
            level: how bad it is.
            message: what is the case, and what to do about it.
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
