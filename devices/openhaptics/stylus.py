"""One stylus inside the servo callback: frames, calibration, errors and force.

It runs a thousand times a second: plain floats, one clock.
"""

from __future__ import annotations

from ctypes import c_double, c_int, c_ubyte
from dataclasses import dataclass
from enum import IntEnum
from math import inf

from devices.haptics.contact import ZERO
from devices.haptics.limits import Limits
from devices.haptics.loop import HapticLoop
from devices.haptics.safety import Condition
from devices.openhaptics.exchange import RingReader, RingWriter, planes_in
from devices.openhaptics.hdapi import (
    FORCE_OUTPUT,
    PLACEHOLDER_MM,
    Calibration,
    Code,
    Get,
    Hdapi,
    Style,
    errors,
)
from devices.openhaptics.motion import Tip
from devices.vendor_axes import Vector3

__all__ = ["Phase", "Spec", "Stylus"]

_CLEAN_FRAMES = 3
"""The scheduler starts before the first frame of a device exists (hopezzzz/3dtouch, touch_hd.py)."""
_WARNING = 1.0
"""Time without a warning of the device after which force may come back, s."""


class Phase(IntEnum):
    """The condition of a stylus."""

    ABSENT = 0
    """It could not be opened."""
    SETTLING = 1
    """It has given no valid frames yet."""
    UNCALIBRATED = 2
    READY = 3
    WARNED = 4
    """It has a pose, and no force: HDAPI has reported an error within the last second."""
    BUSY = 5
    """Another program has it."""
    FAULT = 6
    """It, or the servo callback, has failed."""
    UNWATCHED = 7
    """It has a pose, and no force: the process that watches the servo process gives no sign of life."""

    @property
    def is_lost(self) -> bool:
        """Whether this process cannot use the stylus any more: only a new one can."""
        return self in _LOST

    @property
    def has_pose(self) -> bool:
        """Whether the pose in its states is valid."""
        return self in _POSED


_LOST = {Phase.ABSENT, Phase.BUSY, Phase.FAULT}
_POSED = {Phase.READY, Phase.WARNED, Phase.UNWATCHED}
_READY, _SETTLING, _CALIBRATED = Phase.READY, Phase.SETTLING, Calibration.OK.value
"""As plain names: Python 3.11 takes 0.25 us to look up a member of an enumeration."""


@dataclass(frozen=True)
class Spec:
    """A stylus as the servo process gets it."""

    name: str
    device: str | None
    """Name of the device in the vendor's configuration; None: the default device."""
    dead_man: int | str
    """Index of a button, or `safety-switch`.

    Not the inkwell's switch: a dropped stylus is out of it, too.
    """
    tip_offset: float
    """From the centre of the gimbal to the tip, m."""


class Stylus:
    """An open device of HDAPI. All methods but `allow` are for the servo callback."""

    def __init__(self, hd: Hdapi, handle: int, spec: Spec, models: RingReader, states: RingWriter) -> None:
        """Start without force; there is none before `allow`."""
        self.handle = handle
        self.phase = Phase.SETTLING
        self._hd, self._spec, self._models, self._states = hd, spec, models, states
        self._tip = Tip(spec.tip_offset)
        self._loop: HapticLoop | None = None
        self._code = self._style = 0
        self._calibrated = False
        self._clean = self._placeholders = 0
        self._permitted = False
        self._warned = -inf
        self._transform, self._velocity, self._force = (c_double * 16)(), (c_double * 3)(), (c_double * 3)()
        self._joints = (c_double * 3)()
        self._buttons, self._switch, self._styles = c_int(), c_ubyte(), c_int()

    def allow(self, limits: Limits, *, passivity: bool) -> None:
        """Allow force within `limits`."""
        self._loop = HapticLoop(limits, passivity=passivity)

    def frame(self, now: float, *, watched: bool) -> list[tuple[int, int]]:
        """Do one frame, which begins at `now` (s of time.perf_counter); without force if not `watched`.

        Returns those errors (code, handle) of this tick that are no longer on HDAPI's stack.
        """
        hd = self._hd
        hd.hdBeginFrame(self.handle)
        hd.hdGetDoublev(Get.TRANSFORM, self._transform)
        hd.hdGetDoublev(Get.VELOCITY, self._velocity)
        hd.hdGetIntegerv(Get.BUTTONS, self._buttons)
        self._permitted = self._dead_man()
        moved = self._tip.move(self._transform[:], self._velocity[:], now)
        device_errors = self._calibrate()
        self._judge(now, valid=moved, watched=watched)
        self._send(self._render(now))
        return device_errors

    def on_error(self, code: int, now: float) -> None:
        """Handle an error that is on HDAPI's stack after the frame at `now`.

        Only a fault of the device (0x3xx) ends its use. Any other switches the force off for a time: a
        warning (0x2xx) is meant so, and after an error of the frame it is unknown which force was sent. A
        stylus that is not calibrated has no force.
        """
        if Code.is_busy(code):
            self.phase, self._code = Phase.BUSY, code
        elif Code.is_fault(code):
            self.phase, self._code = Phase.FAULT, code
        elif self._calibrated:
            self._warned, self._code = now, code

    def write_state(self, now: float) -> None:
        """Write the state of the frame at `now`."""
        tip, loop = self._tip, self._loop
        force, cause = (loop.force, _CAUSES[loop.condition]) if loop is not None else (ZERO, _OFF)
        head = (now, self.phase, self._code, self._buttons.value, self._permitted, cause)
        self._states.write((*head, *tip.position, *tip.rotation, *tip.linear, *tip.angular, *force))

    def release(self) -> None:
        """Do one frame without force: the last."""
        self._hd.hdBeginFrame(self.handle)
        if self._loop is not None:
            self._loop.reset()
        self._send(ZERO)

    def _dead_man(self) -> bool:
        dead_man = self._spec.dead_man
        if isinstance(dead_man, int):
            return bool(self._buttons.value >> dead_man & 1)
        self._hd.hdGetBooleanv(Get.SAFETY_SWITCH, self._switch)
        return bool(self._switch.value)

    def _calibrate(self) -> list[tuple[int, int]]:
        """Check the calibration, and update it where possible; return the errors of HDAPI from before.

        Force output is enabled only while the stylus is calibrated.
        """
        hd = self._hd
        calibration = hd.hdCheckCalibration()
        if (calibration == _CALIBRATED) is not self._calibrated:
            self._calibrated = not self._calibrated
            (hd.hdEnable if self._calibrated else hd.hdDisable)(FORCE_OUTPUT)
        if self._calibrated:
            return []
        self._style = self._style or self._best_style()
        # where a person has to put the stylus in place, a button confirms it
        in_place = self._style != Style.ENCODER_RESET or self._buttons.value
        if not (calibration == Calibration.NEEDS_UPDATE and in_place):
            return []
        device_errors = errors(hd)  # also of styluses whose frames were earlier
        hd.hdUpdateCalibration(self._style)
        # other errors mean that the device cannot be calibrated now
        return device_errors + [error for error in errors(hd) if Code.is_fault(error[0])]

    def _best_style(self) -> int:
        self._hd.hdGetIntegerv(Get.CALIBRATION_STYLE, self._styles)
        return next((style for style in Style if self._styles.value & style), 0)

    def _judge(self, now: float, *, valid: bool, watched: bool) -> None:
        phase = self.phase
        if phase.is_lost:
            return
        placeholder = self._is_placeholder()
        self._placeholders = self._placeholders + 1 if placeholder else 0
        self._clean = self._clean + 1 if valid and not placeholder else 0
        if self._placeholders >= _CLEAN_FRAMES:
            self.phase, self._code = Phase.BUSY, 0
        elif self._clean < _CLEAN_FRAMES:
            self.phase = _SETTLING
        elif not self._calibrated:
            self.phase, self._code = Phase.UNCALIBRATED, self._style
        elif now - self._warned < _WARNING:
            self.phase = Phase.WARNED
        elif not watched:
            self.phase, self._code = Phase.UNWATCHED, 0
        elif phase is not _READY:
            self.phase, self._code = _READY, 0

    def _is_placeholder(self) -> bool:
        """Return whether the frame is the one for a process that does not own the device."""
        if tuple(self._transform[12:15]) != PLACEHOLDER_MM:
            return False
        self._hd.hdGetDoublev(Get.JOINT_ANGLES, self._joints)
        return not any(self._joints)

    def _render(self, now: float) -> Vector3:
        """Return the force (N) on the hand."""
        loop = self._loop
        if loop is None:
            return ZERO
        for record in self._models.read():
            loop.receive(planes_in(record), int(record[1]), record[0])
        return loop.tick(
            now, self._tip.position, self._tip.linear, permitted=self._permitted, ready=self.phase is _READY
        )

    def _send(self, force: Vector3) -> None:
        """Set the force (N, base frame) and end the frame."""
        fx, fy, fz = force
        self._force[:] = (-fy, fz, -fx)  # the axes of HDAPI: x right, y up, z towards the user
        self._hd.hdSetDoublev(Get.FORCE, self._force)
        self._hd.hdEndFrame(self.handle)


_CAUSES = {condition: i for i, condition in enumerate(Condition)}
_OFF = _CAUSES[Condition.OFF]
