"""The interface of devices."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from time import sleep
from typing import ClassVar

from hub.participant.base import Participant, Value
from schemas.message import Message

__all__ = ["Device", "Sample"]


@dataclass(frozen=True)
class Sample:
    """One message of a device, stamped in the clock of its port."""

    port: str
    message: Message


class Device(Participant):
    """A participant that lives in wall time, or, if it can play by a script, in simulated time."""

    read_period_ns: ClassVar[int] = 1_000_000
    """How often it is read in wall time where the scenario does not say; a haptic stylus moves and is felt at
    1 kHz.
    """

    @abstractmethod
    def open(self, directory: Path) -> None:
        """Start the device; relative paths of the scenario start at `directory`."""

    @abstractmethod
    def read(self, t: int) -> Iterable[Sample]:
        """Return what is new up to time `t` (ns since the session's start, wall or simulated), oldest first."""

    def wait(self, seconds: float) -> bool:
        """Wait in the thread that reads, until the next period; a device that knows when it has something new
        returns at once, True, and is read.
        """
        sleep(seconds)
        return False

    def write(self, port: str, value: Value) -> None:
        """Take the newest value of a signal, or the next message of an event port.

        A device without inputs is never written to.
        """
