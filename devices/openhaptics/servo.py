"""The servo process: it holds HDAPI and the servo callback, and nothing else. `devices.openhaptics.process` starts it.

One line of JSON on its standard input says what to open; a second one, per stylus, within which limits force may be given. The end of
the input is the end of the process: it comes when the device closes it, and when the device dies. Then the hand is given one last frame, without force.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import json
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from ctypes import c_double
from pathlib import Path
from time import perf_counter
from typing import Any, NoReturn

from devices.haptics.limits import Limits
from devices.openhaptics.exchange import STYLUS_BYTES, attach, servo_ends
from devices.openhaptics.hdapi import (
    CALLBACK_CONTINUE,
    CALLBACK_DONE,
    FORCE_OUTPUT,
    INVALID_HANDLE,
    PRIORITY_MAX,
    SCHEDULER_HERTZ,
    SERVO_CALLBACK,
    Get,
    Hdapi,
    errors,
    load,
)
from devices.openhaptics.stylus import Phase, Spec, Stylus
from schemas.errors import DeviceError

__all__ = ["main"]

_FIFO_PRIORITY = 20
"""Above all that is not real-time, below the kernel's interrupt threads (50)."""
_HIGH_PRIORITY_CLASS = 0x80
_LAST_FRAME_S = 0.1

Say = Callable[[Mapping[str, Any]], None]


class Servo:
    """All styluses of this host behind one callback: HDAPI has one scheduler thread, and a frame makes its device the current one."""

    def __init__(self, hd: Hdapi, styluses: list[Stylus]) -> None:
        """Take the styluses that were opened."""
        self._hd, self._styluses = hd, styluses
        self._by_handle = {stylus.handle: [stylus] for stylus in styluses}
        self._ending, self._ended = False, threading.Event()
        self._callback = SERVO_CALLBACK(self._call)
        self._schedule = 0
        self._known = False
        self.failure = ""
        """What the callback raised."""

    def start(self) -> None:
        """Schedule the callback and start the scheduler, which takes its priority from this thread."""
        self._hd.hdSetSchedulerRate(SCHEDULER_HERTZ)
        self._schedule = self._hd.hdScheduleAsynchronous(self._callback, None, PRIORITY_MAX)
        self._hd.hdStartScheduler()

    def stop(self) -> None:
        """Give the hands a last frame without force, and the devices back; nothing if it was not started."""
        hd = self._hd
        self._ending = True
        if not self._schedule:
            return
        self._ended.wait(_LAST_FRAME_S)
        hd.hdStopScheduler()
        hd.hdUnschedule(self._schedule)
        for stylus in self._styluses:
            hd.hdMakeCurrentDevice(stylus.handle)
            hd.hdDisable(FORCE_OUTPUT)
            hd.hdDisableDevice(stylus.handle)  # crashes with FireWire devices (sawSensablePhantom): so it is the last that this process does

    def tick(self, now: float) -> int:
        """Do the frames of all devices at `now` (s); return what HDAPI wants to know: whether to go on."""
        try:
            if self._ending:
                self._release(now)
                self._ended.set()
                return CALLBACK_DONE
            for stylus in self._styluses:
                stylus.frame(now)
            for code, handle in errors(self._hd):
                for stylus in self._by_handle.get(handle, self._styluses):
                    stylus.note(code, now)
            for stylus in self._styluses:
                stylus.tell(now)
                self._ending = self._ending or stylus.phase.is_lost
        except BaseException as error:  # noqa: BLE001 - what leaves a callback of ctypes is lost, and the force would stay
            self.failure = f"{type(error).__name__}: {error}"
            for stylus in self._styluses:
                stylus.phase = Phase.FAULT
            self._release(now)  # those that have had their frame of this tick get theirs at the next one
            self._ending = True
        return CALLBACK_CONTINUE

    def _call(self, _: object) -> int:
        if not self._known:
            ctypes.pythonapi.PyGILState_Ensure()  # never released: else Python makes and unmakes its state of this thread at every tick
            self._known = True
        return self.tick(perf_counter())

    def _release(self, now: float) -> None:
        for stylus in self._styluses:
            with contextlib.suppress(Exception):  # one that fails here must not keep the others from their last frame
                stylus.release()
                stylus.tell(now)


def _opened(hd: Hdapi, config: Mapping[str, Any], memory: memoryview, say: Say) -> Iterator[tuple[str, Stylus]]:
    """Open the devices; tell of each what it is and bears, or why it cannot be had."""
    for index, values in enumerate(config["styluses"]):
        spec = Spec(**values)
        models, states = servo_ends(memory, index)
        handle = hd.hdInitDevice(None if spec.device is None else spec.device.encode())
        code = next((code for code, _ in errors(hd)), 0)
        if handle == INVALID_HANDLE:
            say({"stylus": spec.name, "absent": code})
            continue
        stylus = Stylus(hd, handle, spec, models, states)
        model, serial = ((hd.hdGetString(what) or b"").decode(errors="replace") for what in (Get.MODEL, Get.SERIAL_NUMBER))
        limits = {"force": _number(hd, Get.MAX_FORCE), "stiffness": 1e3 * _number(hd, Get.MAX_STIFFNESS), "damping": 1e3 * _number(hd, Get.MAX_DAMPING)}
        errors(hd)
        say({"stylus": spec.name, "hardware": f"{model} {serial}".strip(), "limits": limits})
        yield spec.name, stylus


def _number(hd: Hdapi, what: int) -> float:
    value = c_double()
    hd.hdGetDoublev(what, value)
    return value.value


def _raise_priority() -> str:
    """Let this process come first, where the system allows it; return what was reached."""
    if sys.platform == "win32":
        kernel = ctypes.windll.kernel32
        return "high" if kernel.SetPriorityClass(kernel.GetCurrentProcess(), _HIGH_PRIORITY_CLASS) else "normal"
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(_FIFO_PRIORITY))
        return "real-time"
    return "normal"


def _voice() -> Say:
    """Return what writes a message to the device; the standard output is a library's to write to, and goes where errors go."""
    stream = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)

    def say(message: Mapping[str, Any]) -> None:
        stream.write(json.dumps(message) + "\n")

    return say


def _terminate(_signal: int, _frame: object) -> NoReturn:
    sys.exit()


def main() -> NoReturn:
    """Serve until the input ends."""
    signal.signal(signal.SIGTERM, _terminate)
    say = _voice()
    config = json.loads(sys.stdin.readline())
    memory = memoryview(attach(config["memory"], STYLUS_BYTES * len(config["styluses"])))
    try:
        hd = load(Path(config["library"]))
    except DeviceError as error:
        say({"failed": str(error)})
        sys.exit(1)
    say({"loaded": True})
    styluses = dict(_opened(hd, config, memory, say))
    servo = Servo(hd, list(styluses.values()))
    try:
        if styluses:
            say({"priority": _raise_priority()})
            gc.collect()
            gc.freeze()
            gc.disable()
            servo.start()
        for line in sys.stdin:
            order = json.loads(line)
            styluses[order["stylus"]].allow(Limits(**order["limits"]), passivity=order["passivity"])
    finally:
        servo.stop()
        if servo.failure:
            say({"failed": servo.failure})
        os._exit(0)


if __name__ == "__main__":
    main()
