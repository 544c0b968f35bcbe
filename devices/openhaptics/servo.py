"""The servo process: HDAPI and the servo callback, and nothing else.

devices.openhaptics.process starts it. One line of JSON on its standard input lists what to open; a second
one, per stylus, the limits of the force. The process ends with its input, which happens when the device
closes it and when the device's process ends. Then the hand gets one last frame, without force.
"""

from __future__ import annotations

import gc
import json
import os
import signal
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from ctypes import c_double
from pathlib import Path
from time import sleep
from typing import Any, NoReturn

from devices.haptics.limits import Limits
from devices.openhaptics.callback import Servo
from devices.openhaptics.exchange import attach, beat, memory_size, servo_ends
from devices.openhaptics.hdapi import INVALID_HANDLE, Get, Hdapi, errors, load
from devices.openhaptics.priority import SERVO, raise_priority
from devices.openhaptics.stylus import Spec, Stylus
from schemas.errors import DeviceError

__all__ = ["main"]

_FIRST_BEAT = 5.0
"""How long the watcher may take to start, s."""

Say = Callable[[Mapping[str, Any]], None]


def _opened(
    hd: Hdapi, config: Mapping[str, Any], memory: memoryview, say: Say
) -> Iterator[tuple[str, Stylus]]:
    """Open the devices; report model and limits of each, or why it is not available."""
    for index, values in enumerate(config["styluses"]):
        spec = Spec(**values)
        models, states = servo_ends(memory, index)
        handle = hd.hdInitDevice(None if spec.device is None else spec.device.encode())
        code = next((code for code, _ in errors(hd)), 0)
        if handle == INVALID_HANDLE:
            say({"stylus": spec.name, "absent": code})
            continue
        stylus = Stylus(hd, handle, spec, models, states)
        model, serial = (
            (hd.hdGetString(what) or b"").decode(errors="replace") for what in (Get.MODEL, Get.SERIAL_NUMBER)
        )
        limits = {
            "force": _number(hd, Get.MAX_FORCE),
            "stiffness": 1e3 * _number(hd, Get.MAX_STIFFNESS),
            "damping": 1e3 * _number(hd, Get.MAX_DAMPING),
        }
        errors(hd)
        say({"stylus": spec.name, "hardware": f"{model} {serial}".strip(), "limits": limits})
        yield spec.name, stylus


def _number(hd: Hdapi, what: int) -> float:
    value = c_double()
    hd.hdGetDoublev(what, value)
    return value.value


def _await_watcher(sign: memoryview) -> None:
    """Wait until the watcher runs: no tick is without it. Raises DeviceError if it does not start."""
    for _ in range(round(_FIRST_BEAT / 0.005)):
        if sign[0]:
            return
        sleep(0.005)
    raise DeviceError(f"the process that watches the servo process has not started within {_FIRST_BEAT:g} s")


def _output() -> Say:
    """Return a function that sends a message to the device.

    Libraries may write to the standard output, which is redirected to the standard error.
    """
    stream = os.fdopen(os.dup(1), "wb", buffering=0)
    os.dup2(2, 1)

    def say(message: Mapping[str, Any]) -> None:
        with suppress(BrokenPipeError):  # the device's process has ended, and so has the input
            stream.write(json.dumps(message).encode() + b"\n")

    return say


def _terminate(_signal: int, _frame: object) -> NoReturn:
    sys.exit()


def main() -> NoReturn:
    """Serve until the input ends."""
    signal.signal(signal.SIGTERM, _terminate)
    say = _output()
    first = sys.stdin.readline()
    if not first:  # the device's process has ended before it could send it
        sys.exit()
    config = json.loads(first)
    memory = memoryview(attach(config["memory"], memory_size(len(config["styluses"]))))
    try:
        hd = load(Path(config["library"]))
    except DeviceError as error:
        say({"failed": str(error)})
        sys.exit(1)
    say({"loaded": True})
    styluses = dict(_opened(hd, config, memory, say))
    sign = beat(memory)
    servo = Servo(hd, list(styluses.values()), sign)
    try:
        if styluses:
            _await_watcher(sign)
            say({"priority": raise_priority(SERVO)})
            gc.collect()
            gc.freeze()
            gc.disable()
            servo.start()
        for line in sys.stdin:
            order = json.loads(line)
            styluses[order["stylus"]].allow(Limits(**order["limits"]), passivity=order["passivity"])
    except DeviceError as error:
        say({"failed": str(error)})
    finally:
        servo.stop()
        if servo.failure:
            say({"failed": servo.failure})
        os._exit(0)


if __name__ == "__main__":
    main()
