"""The servo loop: a thousand times a second, a tick of all styluses of this host."""

from __future__ import annotations

import contextlib
import threading

from devices.haptics.servo.driver import Driver
from devices.haptics.servo.phase import ServoPhase
from devices.haptics.servo.stylus import Stylus
from schemas.errors import DeviceError

__all__ = ["Servo", "failure_text"]

_LAST_FRAME_S = 0.1
_UNWATCHED, _ABANDONED = 100, 1000
"""Ticks without a sign of life of the watcher: limit for force, and limit for this process. Ticks, not
seconds: after a pause of the whole machine the watcher is not to blame.
"""


class Servo:
    """All styluses of this host behind a single driver."""

    def __init__(self, driver: Driver, styluses: list[Stylus], beat: memoryview) -> None:
        """`styluses`: all open styluses; `beat`: the watcher's counter in the shared memory."""
        self._driver, self._styluses = driver, styluses
        self._by_handle = {stylus.handle: [stylus] for stylus in styluses}
        self._beat, self._last_beat, self._unwatched = beat, 0, 0
        self._ending, self._ended = False, threading.Event()
        self._started = False
        self.failure = ""
        """Error of a tick, in words."""

    def start(self) -> None:
        """Start the driver's loop, with the priority of this thread."""
        self._started = True
        self._driver.start(self.tick)

    def stop(self) -> None:
        """Give the hands a last tick without force, and release the devices, if the loop was started."""
        self._ending = True
        if not self._started:
            return
        self._ended.wait(_LAST_FRAME_S)
        self._driver.stop()
        for stylus in self._styluses:
            self._driver.close(stylus.handle)

    def tick(self, now: float) -> bool:
        """Do a tick of all devices at `now` (s); return whether there shall be another."""
        try:
            if self._ending:
                self._release(now)
                self._ended.set()
                return False
            watched = self._is_watched()
            for stylus in self._styluses:
                stylus.frame(now, watched=watched)
            for code, handle, phase in self._driver.errors():
                for stylus in self._by_handle.get(handle, self._styluses):
                    stylus.on_error(code, phase, now)
            for stylus in self._styluses:
                stylus.write_state(now)
                self._ending = self._ending or stylus.phase.is_lost
        # an exception that leaves a callback of ctypes is lost, and the force would stay
        except BaseException as error:  # noqa: BLE001
            self.failure = failure_text(error)
            for stylus in self._styluses:
                stylus.phase = ServoPhase.FAULT
            self._release(now)  # styluses that had their frame of this tick get the last one at the next
            self._ending = True
        return True

    def _is_watched(self) -> bool:
        """Return whether the watcher runs. Raises DeviceError after a long silence."""
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


def failure_text(error: BaseException) -> str:
    """Return an error in words; with the class unless we raise it on purpose: a driver may raise anything."""
    return str(error) if isinstance(error, DeviceError) else f"{type(error).__name__}: {error}"
