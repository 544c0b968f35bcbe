"""The interface of devices."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from time import sleep
from typing import ClassVar

from hub.participant.base import Participant, Value
from schemas.codec import encode
from schemas.message import Message
from schemas.vectors import Vector, VectorCodec

__all__ = ["Device", "Sample", "VectorSample"]


@dataclass(frozen=True)
class Sample:
    """A message of a device, stamped in the clock of the port.

    Examples:
        Sample("pose", PoseStamped(header=Header(stamp=Time.from_ns(t), frame_id="stylus_base")))
    """

    port: str
    message: Message

    def encode(self) -> bytes:
        """Return the message as CDR."""
        return encode(self.message)


class VectorSample(Sample):
    """A sample of a signal as numbers, for devices with a high sampling rate: the message is made on demand.

    Examples:
        VectorSample(VectorCodec(port), np.array([x, y, z, qx, qy, qz, qw]), t)
    """

    _codec: VectorCodec
    _value: Vector
    _time_ns: int

    def __init__(self, codec: VectorCodec, value: Vector, time_ns: int) -> None:
        """Store a value, shape (size,), of the codec's port, stamped in the port's clock.

        Raises MessageError for another shape, or for numbers that are not finite.
        """
        if value.shape != codec.neutral.shape or not isfinite(value.dot(value)):
            codec.check_vector(value)  # raises what is wrong, unless the numbers are only large
        vars(self).update(port=codec.port.name, _codec=codec, _value=value, _time_ns=time_ns)

    def __getattr__(self, name: str) -> Message:
        """Return the message, made at the first access."""
        if name != "message":
            raise AttributeError(f"'{type(self).__name__}' object has no attribute '{name}'")
        made = vars(self)["message"] = self._codec.to_message(self._value, self._time_ns)
        return made

    def is_of(self, codec: VectorCodec | None) -> bool:
        """Return whether type, frame and names fit the codec's port: the sample's bytes need no check."""
        return codec is not None and self._codec.template == codec.template

    def encode(self) -> bytes:
        """Return the message as CDR."""
        return self._codec.encode(self._value, self._time_ns)


class Device(Participant):
    """A participant in wall time or, with all outputs stamped in simulated time, in simulated time.

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
    """Default time between two reads in wall time: a haptic stylus is read and driven at 1 kHz."""

    use_period_ns: int = 0
    """Period at which the device uses the newest values of its signals, in wall time; 0: every value is used.

    Surplus values within a period are not all sent to the device.
    """

    @abstractmethod
    def open(self, directory: Path) -> None:
        """Start the device; relative paths of the scenario start at `directory`."""

    @abstractmethod
    def read(self, t: int) -> Iterable[Sample]:
        """Return the new samples up to `t` (ns since the session's start, wall or simulated time)."""

    def wait(self, seconds: float) -> bool:
        """Wait until the next period, in the reading thread.

        A device with knowledge of its next sample returns True as soon as the sample is there, to be read at
        once.
        """
        sleep(seconds)
        return False

    def unused(self) -> Collection[str]:
        """Return the signals not needed until further notice: their values are not sent.

        Called after each `read`; return the same collection as long as nothing has changed.
        """
        return ()

    def write(self, port: str, value: Value) -> None:
        """Accept the newest value of a signal, or the next message of an event port.

        Never called for a device without inputs.
        """
