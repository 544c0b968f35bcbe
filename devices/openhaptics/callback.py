"""The servo callback: a thousand times a second, the frames of all styluses of this host."""

from __future__ import annotations

import contextlib
import ctypes
import threading
from time import perf_counter

from devices.openhaptics.hdapi import (
    CALLBACK_CONTINUE,
    CALLBACK_DONE,
    FORCE_OUTPUT,
    PRIORITY_MAX,
    SCHEDULER_HERTZ,
    SERVO_CALLBACK,
    Hdapi,
    errors,
)
from devices.openhaptics.stylus import Phase, Stylus
from schemas.errors import DeviceError

__all__ = ["Servo"]

_LAST_FRAME_S = 0.1
_UNWATCHED, _ABANDONED = 100, 1000
"""Ticks without a sign of life of the watcher after which there is no force, and after which this process is
of no use. Ticks, not seconds: after a pause of the whole machine the watcher is not the one to blame.
"""


class Servo:
    """All styluses of this host behind one callback.

    HDAPI has one scheduler thread, and a frame makes its device the current one.
    """

    def __init__(self, hd: Hdapi, styluses: list[Stylus], beat: memoryview) -> None:
        """`styluses`: those that were opened; `beat`: the watcher's counter in the shared memory."""
        self._hd, self._styluses = hd, styluses
        self._by_handle = {stylus.handle: [stylus] for stylus in styluses}
        self._beat, self._last_beat, self._unwatched = beat, 0, 0
        self._ending, self._ended = False, threading.Event()
        self._callback = SERVO_CALLBACK(self._call)
        self._schedule: int | None = None
        self._known = False
        self.failure = ""
        """What the callback raised."""

    def start(self) -> None:
        """Schedule the callback and start the scheduler, which takes its priority from this thread."""
        self._hd.hdSetSchedulerRate(SCHEDULER_HERTZ)
        self._schedule = self._hd.hdScheduleAsynchronous(self._callback, None, PRIORITY_MAX)
        self._hd.hdStartScheduler()

    def stop(self) -> None:
        """Give the hands a last frame without force, and release the devices, if it was started."""
        hd = self._hd
        self._ending = True
        if self._schedule is None:  # 0 may be a schedule
            return
        self._ended.wait(_LAST_FRAME_S)
        hd.hdStopScheduler()
        hd.hdUnschedule(self._schedule)
        for stylus in self._styluses:
            hd.hdMakeCurrentDevice(stylus.handle)
            hd.hdDisable(FORCE_OUTPUT)
            # crashes with FireWire devices (sawSensablePhantom), so it is the last action of this process
            hd.hdDisableDevice(stylus.handle)

    def tick(self, now: float) -> int:
        """Do the frames of all devices at `now` (s); return whether HDAPI shall call again."""
        try:
            if self._ending:
                self._release(now)
                self._ended.set()
                return CALLBACK_DONE
            watched = self._is_watched()
            device_errors = [
                device_error
                for stylus in self._styluses
                for device_error in stylus.frame(now, watched=watched)
            ]
            for code, handle in device_errors + errors(self._hd):
                for stylus in self._by_handle.get(handle, self._styluses):
                    stylus.on_error(code, now)
            for stylus in self._styluses:
                stylus.write_state(now)
                self._ending = self._ending or stylus.phase.is_lost
        # an exception that leaves a ctypes callback is lost, and the force would stay
        except BaseException as error:  # noqa: BLE001
            known = isinstance(error, DeviceError)
            self.failure = str(error) if known else f"{type(error).__name__}: {error}"
            for stylus in self._styluses:
                stylus.phase = Phase.FAULT
            self._release(now)  # styluses that had their frame of this tick get the last one at the next
            self._ending = True
        return CALLBACK_CONTINUE

    def _call(self, _: object) -> int:
        if not self._known:
            # never released: otherwise Python creates and destroys its thread state at every tick
            ctypes.pythonapi.PyGILState_Ensure()
            self._known = True
        return self.tick(perf_counter())

    def _is_watched(self) -> bool:
        """Return whether the watcher runs. Raises DeviceError if it has not for long."""
        beat = self._beat[0]
        self._unwatched = 0 if beat != self._last_beat else self._unwatched + 1
        self._last_beat = beat
        if self._unwatched >= _ABANDONED:
            raise DeviceError("the process that watches the servo process has ended or stands still")
        return self._unwatched < _UNWATCHED

    def _release(self, now: float) -> None:
        for stylus in self._styluses:
            # a failure here must not prevent the last frame of the others
            with contextlib.suppress(Exception):
                stylus.release()
                stylus.write_state(now)
