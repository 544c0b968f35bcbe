"""The watcher process: kills a stalled servo process with force on a hand.

A motor keeps the last force while the servo stands still: stopped by a signal, or blocked in a call of the
driver. Libraries give a device to a single process, so no second process can set the force to zero; the end
of the servo process closes the device.

devices.haptics.servo.process starts the watcher beside every servo process, with the shared memory and a
handle of the servo process. Only the end of the servo process ends the watcher: the device's process may
have died before. Each of the three has a separate interpreter, so none delays another. The sign of life is
a counter in the shared memory; without a sign the servo gives no force (devices.haptics.servo.servo).
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import select
import signal
import sys
from collections.abc import Sequence
from time import perf_counter
from typing import NoReturn

from devices.haptics.safety import Condition
from devices.haptics.servo.exchange import RingReader, State, attach, beat, device_ends, memory_size
from devices.haptics.servo.priority import WATCHER, raise_priority

__all__ = ["HAS_KILLED", "PERIOD", "Target", "Watch", "main"]

PERIOD = 0.004
"""Time between two looks, s."""
_STILL = 0.11
"""Least age of the last frame of a stalled servo, s: a stop of 0.1 s is left alone."""
_LOOKS = 3
"""Looks in a row before a kill: after a pause of the whole machine the servo gets time for a tick."""
HAS_KILLED = 3
"""Exit status after the servo process was killed."""

_OFF = tuple(Condition).index(Condition.OFF)


class Watch:
    """Finds a servo stalled while there may be force on a hand."""

    def __init__(self, states: Sequence[RingReader]) -> None:
        """`states`: the reading ends of all styluses of the servo process."""
        self._states = states
        self._newest: list[State | None] = [None] * len(states)
        self._looks = 0

    def look(self, now: float) -> bool:
        """Return whether the servo must be killed, at `now` (s of time.perf_counter)."""
        still = False
        for index, ring in enumerate(self._states):
            if records := ring.read():
                self._newest[index] = State.of(records[-1])
            newest = self._newest[index]
            # A tick whose force is off for `Condition.OFF` is followed by at least three without force (the
            # chain waits for calm ticks first), so an unknown tick in which a call blocks has none either.
            still = still or (newest is not None and newest.cause != _OFF and now - newest.time > _STILL)
        self._looks = self._looks + 1 if still else 0
        return self._looks >= _LOOKS


class Target:
    """The servo process, by a handle never reused for another process."""

    def __init__(self, handle: int) -> None:
        """`handle`: a process file descriptor, on Windows the id of a process not yet reaped."""
        self._handle = handle
        if sys.platform == "win32":
            terminate, synchronize = 0x1, 0x100000
            kernel = ctypes.windll.kernel32
            kernel.OpenProcess.restype = ctypes.c_void_p
            kernel.WaitForSingleObject.argtypes = (ctypes.c_void_p, ctypes.c_uint)
            kernel.TerminateProcess.argtypes = (ctypes.c_void_p, ctypes.c_uint)
            self._process = kernel.OpenProcess(terminate | synchronize, False, handle)
        else:
            self._poll = select.poll()
            self._poll.register(handle, select.POLLIN)

    def has_ended(self, timeout_s: float) -> bool:
        """Wait for the end of the process, up to `timeout_s`; return whether the process has ended."""
        if sys.platform == "win32":
            timed_out = 0x102
            return (
                ctypes.windll.kernel32.WaitForSingleObject(self._process, round(timeout_s * 1e3)) != timed_out
            )
        return bool(self._poll.poll(timeout_s * 1e3))

    def kill(self) -> None:
        """End the process at once, in any state."""
        if sys.platform == "win32":
            ctypes.windll.kernel32.TerminateProcess(self._process, 1)
        else:
            with contextlib.suppress(ProcessLookupError):  # it has just ended
                signal.pidfd_send_signal(self._handle, signal.SIGKILL)


def main() -> NoReturn:
    """Watch until the servo process has ended: `watcher MEMORY STYLUSES PROCESS`."""
    memory_handle, styluses, process = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    memory = memoryview(attach(memory_handle, memory_size(styluses)))
    sign = beat(memory)
    watch = Watch([device_ends(memory, index)[1] for index in range(styluses)])
    target = Target(process)
    raise_priority(WATCHER)
    gc.collect()
    gc.freeze()
    gc.disable()
    has_killed = False
    while not target.has_ended(PERIOD):
        sign[0] += 1
        if not has_killed and watch.look(perf_counter()):
            target.kill()
            has_killed = True
    sys.exit(HAS_KILLED if has_killed else 0)


if __name__ == "__main__":
    main()
