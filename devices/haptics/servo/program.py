"""The servo process: a vendor's library and the servo loop, and nothing else.

devices.haptics.servo.process starts it. The first line of JSON on the standard input names the driver and the
styluses; each later line states the limits of the force of a stylus. The process ends with the input: when
the device closes the input, and when the device's process ends. Then the hand gets a last frame without
force.
"""

from __future__ import annotations

import gc
import json
import os
import signal
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from importlib import import_module
from time import sleep
from typing import Any, NoReturn

from devices.haptics.limits import Limits
from devices.haptics.servo.driver import Driver, StylusSpec, Unavailable
from devices.haptics.servo.exchange import attach, beat, memory_size, servo_ends
from devices.haptics.servo.priority import SERVO, raise_priority
from devices.haptics.servo.servo import Servo, failure_text
from devices.haptics.servo.stylus import Stylus
from schemas.errors import DeviceError

__all__ = ["main"]

_FIRST_BEAT = 5.0
"""How long the watcher may take to start, s."""

Say = Callable[[Mapping[str, Any]], None]


def _load(choice: str, options: Mapping[str, Any]) -> Driver:
    """Return the driver of a class `module:Class`. Raises DeviceError if the class cannot be loaded."""
    module, _, name = choice.partition(":")
    try:
        kind: Any = getattr(import_module(module), name)
    except (ImportError, AttributeError) as error:
        raise DeviceError(f"the driver '{choice}' cannot be imported: {error}") from error
    return kind(**options)


def _open_styluses(
    driver: Driver, config: Mapping[str, Any], memory: memoryview, say: Say
) -> Iterator[tuple[str, Stylus]]:
    """Open the devices; report model and limits of each, or the reason of a failure."""
    for index, values in enumerate(config["styluses"]):
        spec = StylusSpec(**values)
        models, states = servo_ends(memory, index)
        opened = driver.open(spec)
        if isinstance(opened, Unavailable):
            say({"stylus": spec.name, "absent": opened.code, "phase": opened.phase})
            continue
        limits = {"force": opened.force, "stiffness": opened.stiffness, "damping": opened.damping}
        say({"stylus": spec.name, "hardware": opened.hardware, "limits": limits})
        yield spec.name, Stylus(driver, opened.handle, spec, models, states)


def _await_watcher(sign: memoryview) -> None:
    """Wait for the watcher: no tick runs without a watcher. Raises DeviceError after five seconds."""
    for _ in range(round(_FIRST_BEAT / 0.005)):
        if sign[0]:
            return
        sleep(0.005)
    raise DeviceError(f"the process that watches the servo process has not started within {_FIRST_BEAT:g} s")


def _output() -> Say:
    """Return a function to send a message to the device.

    The standard output is redirected to the standard error: libraries may write there.
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
        driver = _load(config["driver"], config["options"])
        say({"loaded": True})
        styluses = dict(_open_styluses(driver, config, memory, say))
    except Exception as error:  # noqa: BLE001  # a driver may raise anything
        say({"failed": failure_text(error)})
        sys.exit(1)
    sign = beat(memory)
    servo = Servo(driver, list(styluses.values()), sign)
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
    except Exception as error:  # noqa: BLE001  # likewise: the device must hear of it
        say({"failed": failure_text(error)})
    finally:
        servo.stop()
        if servo.failure:
            say({"failed": servo.failure})
        os._exit(0)


if __name__ == "__main__":
    main()
