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
    """One message of a device, stamped in the clock of its port.

    Examples:
        Sample("pose", PoseStamped(header=Header(stamp=Time.from_ns(t), frame_id="stylus_base")))
    """

    port: str
    message: Message


class Device(Participant):
    """A participant that lives in wall time or, if all its outputs are stamped with it, in simulated time.

        class Pedal(Device):
            ports = (Port(name="pressed", causality="output", type="std_msgs/msg/Float64", clock="wall"),)

            def open(self, directory: Path) -> None:
                self.handle = open_pedal()

            def read(self, t: int) -> Iterable[Sample]:
                return [Sample("pressed", Float64Message(data=self.handle.read()))]

            def close(self) -> None:
                self.handle.close()

    Samples enter the simulation through inlets at communication points, and only there.
    """

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
