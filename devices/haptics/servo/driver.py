"""The interface between the servo process and a vendor's library.

The servo process makes a single driver for all styluses of a host, of the class named by the device. Each
tick is `read`, then `write`, stylus after stylus, then `errors`. Watchdog, dead-man, clamp, slew and ramp are
part of the servo, so no driver can leave a limit out.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from devices.haptics.contact import ZERO
from devices.haptics.servo.phase import ServoPhase
from devices.haptics.servo.timed_loop import TimedLoop
from devices.vendor_axes import Vector3

__all__ = ["Driver", "DriverError", "Opened", "Reading", "StylusSpec", "Unavailable"]


@dataclass(frozen=True)
class StylusSpec:
    """A stylus as described to the servo process."""

    name: str
    device: str | None
    """Name of the device in the vendor's configuration; None: the default device."""
    dead_man: int | str
    """Index of a button, or `safety-switch`.

    Not the inkwell's switch: a dropped stylus is out of the inkwell, too.
    """
    tip_offset: float
    """Distance to the tip from the point of the library's poses, m."""


class Opened(NamedTuple):
    """An open stylus. A limit of 0 is not stated: the limit of a 3D Systems Touch applies."""

    handle: int
    """The driver's own number for the stylus."""
    hardware: str
    """Model and serial number."""
    force: float = 0.0
    """Nominal maximum force, N."""
    stiffness: float = 0.0
    """Nominal maximum stiffness, N/m."""
    damping: float = 0.0
    """Nominal maximum damping, N s/m."""


class Unavailable(NamedTuple):
    """Why a stylus could not be opened."""

    code: int = 0
    """Error code of the library, or 0."""
    phase: ServoPhase = ServoPhase.ABSENT
    """ABSENT or BUSY."""


class Reading(NamedTuple):
    """A stylus at the beginning of a tick: base frame (x ahead, y left, z up), SI units."""

    position: Vector3
    """Tip position, m."""
    rotation: tuple[float, ...]
    """Rotation matrix of the stylus' own frame (z out of the point), nine numbers, row after row."""
    linear: Vector3
    """Tip velocity, m/s."""
    angular: Vector3 = ZERO
    """Angular velocity, rad/s."""
    buttons: int = 0
    """Pressed buttons; bit 0 is the first."""
    switch: bool = False
    """Whether the safety switch is held; False without a switch."""
    valid: bool = True
    """Whether the pose is valid."""
    owned: bool = True
    """False: another program has the stylus; these numbers are placeholders."""
    calibrated: bool = True
    style: int = 0
    """The driver's number for the way of calibrating an uncalibrated stylus."""


class DriverError(NamedTuple):
    """An error reported by the library."""

    code: int
    handle: int
    """The stylus; a number of no open stylus means all."""
    phase: ServoPhase
    """WARNED: no force for a second; BUSY or FAULT: the stylus is lost."""


class Driver(ABC):
    """Styluses of a vendor. All methods but `open`, `start`, `stop` and `close` run in the servo loop."""

    rate = 1000.0
    """Ticks per second of the default loop."""

    def __init__(self) -> None:
        """Load the library. Raises DeviceError if the library cannot be loaded.

        A subclass takes the device's `driver_options` as keyword arguments.
        """
        self._timed_loop: TimedLoop | None = None

    @abstractmethod
    def open(self, spec: StylusSpec) -> Opened | Unavailable:
        """Open a stylus, without force."""

    @abstractmethod
    def read(self, handle: int, now: float) -> Reading:
        """Begin a tick at `now` (s of time.perf_counter) and return the stylus' measurements."""

    @abstractmethod
    def write(self, handle: int, force: Vector3) -> None:
        """Set the force (N, base frame) on the hand, and end the tick."""

    def release(self, handle: int) -> None:
        """Set the force to zero, also in the middle of a tick."""
        self.write(handle, ZERO)

    def errors(self) -> Sequence[DriverError]:
        """Return the errors since the last call, the newest first."""
        return ()

    def start(self, tick: Callable[[float], bool]) -> None:
        """Start calling `tick` (now in s of time.perf_counter) at `rate`, until `tick` returns False."""
        self._timed_loop = TimedLoop(self.rate, tick)

    def stop(self) -> None:
        """End the calls."""
        if self._timed_loop is not None:
            self._timed_loop.stop()

    @abstractmethod
    def close(self, handle: int) -> None:
        """Switch the motors off and release the stylus."""
