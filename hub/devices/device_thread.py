"""A device that lives in wall time: a thread reads it at its own rate, and when it has something new, whether
or not a hub is there to be told.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from pathlib import Path
from time import monotonic_ns
from typing import Protocol

from hub.devices.simulated_devices import open_device
from hub.participant import Device, Sample, Value
from schemas.errors import MessageError
from schemas.ros import DiagnosticStatus, Joy

__all__ = ["DeviceThread", "Uplink"]

log = logging.getLogger(__name__)

_LONGEST_SLEEP_S = 0.05
_LINK_NS = 1_000_000
"""How often a link is asked what has come through it."""
_STATES = (Joy, DiagnosticStatus)


class Uplink(Protocol):
    """Where the samples go."""

    def exchange(self, t: int, samples: list[Sample]) -> bool:
        """Take the samples read at `t` (ns since the loop's start); return whether a link holds things up, so
        that it wants to be asked again soon.
        """
        ...


class DeviceThread:
    """Reads a device at its period; what it says goes to the uplink that is attached, and to nobody while
    there is none.
    """

    def __init__(
        self, name: str, device: Device, period_ns: int, *, failed: Callable[[str, str], None]
    ) -> None:
        """`failed` is told the device's name and the cause when the loop ends by an error."""
        self._name, self._device, self._period_ns, self._failed = name, device, period_ns, failed
        self._uplink: Uplink | None = None
        self._attaching = threading.Lock()
        self._standing: dict[str, Sample] = {}
        """The newest buttons and diagnosis of each port: they hold until another one is told."""
        self._ending = False
        self._start_ns = monotonic_ns()
        self._thread = threading.Thread(target=self._run, name=f"device {name}", daemon=True)

    @property
    def now_ns(self) -> int:
        """Time since the loop's start."""
        return monotonic_ns() - self._start_ns

    def start(self, directory: Path) -> None:
        """Open the device and begin to read it."""
        open_device(self._name, self._device, directory)
        self._start_ns = monotonic_ns()
        self._thread.start()

    def attach(self, uplink: Uplink | None) -> None:
        """Give what is read from now on to `uplink`; the one before gets nothing any more once this returns.

        First of all it gets buttons and diagnoses as they are: they may have changed while nobody listened.
        """
        with self._attaching:
            self._uplink = uplink
            if uplink is not None and self._standing:
                uplink.exchange(self.now_ns, list(self._standing.values()))

    def write(self, port: str, value: Value) -> None:
        """Write to the device; may be called from any thread.

        Raises MessageError if it refuses the value; anything else ends the loop.
        """
        try:
            self._device.write(port, value)
        except MessageError:
            raise
        except Exception as error:  # noqa: BLE001  # it is logged and told
            self._fail(error)

    def _run(self) -> None:
        due_ns = self._start_ns
        try:
            while not self._ending:
                t = self.now_ns
                samples = list(self._device.read(t))
                delayed = False
                with self._attaching:
                    self._standing.update(
                        (sample.port, sample)
                        for sample in samples
                        if isinstance(sample.message, Joy | DiagnosticStatus)
                    )
                    if self._uplink is not None:
                        delayed = self._uplink.exchange(t, samples)
                if self._start_ns + t >= due_ns:  # it was not read early
                    period_ns = min(self._period_ns, _LINK_NS) if delayed else self._period_ns
                    due_ns = max(due_ns + period_ns, self._start_ns + t)  # what is late is not caught up
                while not self._ending and (left_ns := due_ns - monotonic_ns()) > 0:
                    if self._device.wait(min(left_ns / 1e9, _LONGEST_SLEEP_S)):
                        break
        except Exception as error:  # noqa: BLE001  # it is logged and told
            self._fail(error)

    def _fail(self, error: Exception) -> None:
        if not self._ending:
            self._ending = True
            log.error("device '%s' has failed", self._name, exc_info=error)
            self._failed(self._name, f"{type(error).__name__}: {error}")

    def close(self) -> None:
        """End the loop and close the device."""
        self._ending = True
        if self._thread.is_alive():
            self._thread.join(timeout=2.0)
        self._device.close()
