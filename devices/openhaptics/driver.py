"""HDAPI as a driver of the servo process: frames, calibration and errors of the styluses."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable, Sequence
from ctypes import c_double, c_int, c_ubyte
from pathlib import Path
from time import perf_counter
from typing import Any

from devices.haptics.contact import ZERO
from devices.haptics.servo.driver import Driver, DriverError, Opened, Reading, StylusSpec, Unavailable
from devices.haptics.servo.phase import ServoPhase
from devices.openhaptics.hdapi import (
    CALLBACK_CONTINUE,
    CALLBACK_DONE,
    FORCE_OUTPUT,
    INVALID_HANDLE,
    PLACEHOLDER_MM,
    PRIORITY_MAX,
    SCHEDULER_HERTZ,
    SERVO_CALLBACK,
    Calibration,
    Code,
    Get,
    Hdapi,
    Style,
    errors,
    load,
)
from devices.openhaptics.motion import Tip
from devices.vendor_axes import Vector3

__all__ = ["HdapiDriver"]

_CALIBRATED = Calibration.OK.value
_CONFIGURATION = "/usr/share/3DSystems"
"""The Linux driver needs to know the directory of the devices' configuration and calibration (TouchDriver
2019.2.15).
"""


class HdapiDriver(Driver):
    """All devices of HDAPI. There is a single scheduler thread; a frame makes a device the current device."""

    def __init__(self, library: str) -> None:
        """Load the library. Raises DeviceError if the file is no HDAPI."""
        super().__init__()
        if sys.platform != "win32":
            os.environ.setdefault("GTDD_HOME", _CONFIGURATION)
        self.hd: Hdapi = load(Path(library))
        self._devices: dict[int, _Device] = {}
        self._callback: Any = None
        self._schedule: int | None = None

    def open(self, spec: StylusSpec) -> Opened | Unavailable:
        """Open a device, with HDAPI's nominal limits."""
        hd = self.hd
        handle = hd.hdInitDevice(None if spec.device is None else spec.device.encode())
        code = next((code for code, _ in errors(hd)), 0)
        if handle == INVALID_HANDLE:
            return Unavailable(code, ServoPhase.BUSY if Code.is_busy(code) else ServoPhase.ABSENT)
        self._devices[handle] = _Device(hd, handle, spec)
        model, serial = (
            (hd.hdGetString(what) or b"").decode(errors="replace") for what in (Get.MODEL, Get.SERIAL_NUMBER)
        )
        force, stiffness, damping = map(self._number, (Get.MAX_FORCE, Get.MAX_STIFFNESS, Get.MAX_DAMPING))
        errors(hd)
        return Opened(handle, f"{model} {serial}".strip(), force, 1e3 * stiffness, 1e3 * damping)

    def read(self, handle: int, now: float) -> Reading:
        """Begin a frame and calibrate where possible."""
        return self._devices[handle].read(now)

    def write(self, handle: int, force: Vector3) -> None:
        """Set the force (N, base frame) and end the frame."""
        self._devices[handle].write(force)

    def release(self, handle: int) -> None:
        """Do a frame without force."""
        self.hd.hdBeginFrame(handle)
        self._devices[handle].write(ZERO)

    def errors(self) -> Sequence[DriverError]:
        """Return the errors of this tick: first the calibration's, then HDAPI's stack."""
        found = [error for device in self._devices.values() for error in device.pop_errors()]
        found += errors(self.hd)
        return [DriverError(code, handle, _phase_after_error(code)) for code, handle in found]

    def start(self, tick: Callable[[float], bool]) -> None:
        """Schedule the callback and start the scheduler, with the priority of this thread."""
        known = False

        def call(_: object) -> int:
            nonlocal known
            if not known:
                # never released: otherwise Python creates and destroys its thread state at every tick
                ctypes.pythonapi.PyGILState_Ensure()
                known = True
            return CALLBACK_CONTINUE if tick(perf_counter()) else CALLBACK_DONE

        self._callback = SERVO_CALLBACK(call)
        self.hd.hdSetSchedulerRate(SCHEDULER_HERTZ)
        self._schedule = self.hd.hdScheduleAsynchronous(self._callback, None, PRIORITY_MAX)
        self.hd.hdStartScheduler()

    def stop(self) -> None:
        """Stop the scheduler."""
        if self._schedule is not None:  # 0 may be a schedule
            self.hd.hdStopScheduler()
            self.hd.hdUnschedule(self._schedule)

    def close(self, handle: int) -> None:
        """Switch the motors off and release the device."""
        self.hd.hdMakeCurrentDevice(handle)
        self.hd.hdDisable(FORCE_OUTPUT)
        # crashes with FireWire devices (sawSensablePhantom), so it is the last action of this process
        self.hd.hdDisableDevice(handle)

    def _number(self, what: int) -> float:
        value = c_double()
        self.hd.hdGetDoublev(what, value)
        return value.value


class _Device:
    """An open device. All methods are for the servo callback."""

    def __init__(self, hd: Hdapi, handle: int, spec: StylusSpec) -> None:
        self._hd, self._handle = hd, handle
        self._has_switch = not isinstance(spec.dead_man, int)
        self._tip = Tip(spec.tip_offset)
        self._style = 0
        self._calibrated = False
        self._errors: list[tuple[int, int]] = []
        self._transform, self._velocity, self._force = (c_double * 16)(), (c_double * 3)(), (c_double * 3)()
        self._joints = (c_double * 3)()
        self._buttons, self._switch, self._styles = c_int(), c_ubyte(), c_int()

    def read(self, now: float) -> Reading:
        """Begin a frame at `now` (s)."""
        hd, tip = self._hd, self._tip
        hd.hdBeginFrame(self._handle)
        hd.hdGetDoublev(Get.TRANSFORM, self._transform)
        hd.hdGetDoublev(Get.VELOCITY, self._velocity)
        hd.hdGetIntegerv(Get.BUTTONS, self._buttons)
        if self._has_switch:
            hd.hdGetBooleanv(Get.SAFETY_SWITCH, self._switch)
        moved = tip.move(self._transform[:], self._velocity[:], now)
        self._run_calibration()
        return Reading(
            tip.position,
            tip.rotation,
            tip.linear,
            tip.angular,
            self._buttons.value,
            bool(self._switch.value),
            moved,
            not self._is_placeholder(),
            self._calibrated,
            self._style,
        )

    def write(self, force: Vector3) -> None:
        """Set the force (N, base frame) and end the frame."""
        fx, fy, fz = force
        self._force[:] = (-fy, fz, -fx)  # the axes of HDAPI: x right, y up, z towards the user
        self._hd.hdSetDoublev(Get.FORCE, self._force)
        self._hd.hdEndFrame(self._handle)

    def pop_errors(self) -> list[tuple[int, int]]:
        """Return the errors (code, handle) of this tick from before the calibration, once each."""
        found, self._errors = self._errors, []
        return found

    def _run_calibration(self) -> None:
        """Check the calibration, and update where possible; keep the errors of HDAPI from before.

        Force output is enabled only while the stylus is calibrated.
        """
        hd = self._hd
        calibration = hd.hdCheckCalibration()
        if (calibration == _CALIBRATED) is not self._calibrated:
            self._calibrated = not self._calibrated
            (hd.hdEnable if self._calibrated else hd.hdDisable)(FORCE_OUTPUT)
        if self._calibrated:
            return
        self._style = self._style or self._best_style()
        # where a person has to put the stylus in place, a button confirms it
        in_place = self._style != Style.ENCODER_RESET or self._buttons.value
        if not (calibration == Calibration.NEEDS_UPDATE and in_place):
            return
        self._errors += errors(hd)  # also of styluses whose frames were earlier
        hd.hdUpdateCalibration(self._style)
        # other errors mean that the device cannot be calibrated now
        self._errors += [error for error in errors(hd) if Code.is_fault(error[0])]

    def _best_style(self) -> int:
        self._hd.hdGetIntegerv(Get.CALIBRATION_STYLE, self._styles)
        return next((style for style in Style if self._styles.value & style), 0)

    def _is_placeholder(self) -> bool:
        """Return whether HDAPI gives a placeholder: another process owns the device."""
        if tuple(self._transform[12:15]) != PLACEHOLDER_MM:
            return False
        self._hd.hdGetDoublev(Get.JOINT_ANGLES, self._joints)
        return not any(self._joints)


def _phase_after_error(code: int) -> ServoPhase:
    """Return the condition of the stylus after an error; only a fault of the device (0x3xx) ends the use."""
    if Code.is_busy(code):
        return ServoPhase.BUSY
    return ServoPhase.FAULT if Code.is_fault(code) else ServoPhase.WARNED
