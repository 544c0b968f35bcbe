"""A device in wall time: a thread reads the device at its own rate, and as soon as there is something new."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Collection
from pathlib import Path
from time import monotonic_ns
from typing import Protocol

from hub.devices.simulated_devices import close_device, open_device
from hub.participant import Device, Sample, Value, VectorSample
from schemas.errors import MessageError
from schemas.ros import DiagnosticStatus, Joy

__all__ = ["DeviceThread", "Uplink"]

log = logging.getLogger(__name__)

_LONGEST_SLEEP_S = 0.05
_LINK_NS = 1_000_000
"""Period of calls to an uplink while the network link delays messages."""


class Uplink(Protocol):
    """Where the samples go."""

    def exchange(self, t: int, samples: list[Sample]) -> bool:
        """Send the samples read at `t` (ns since the thread's start).

        Returns whether a network link delays anything, and the next call must come soon.
        """
        ...


class DeviceThread:
    """Reads a device at its period, with or without a hub: samples go to the attached uplink.

    `failed` is called with the device's name and the cause when an error ends the thread.
    """

    def __init__(
        self, name: str, device: Device, period_ns: int, *, failed: Callable[[str, str], None]
    ) -> None:
        self._name, self._device, self._period_ns, self._failed = name, device, period_ns, failed
        self._uplink: Uplink | None = None
        self._attaching = threading.Lock()
        self._current: dict[str, Sample] = {}
        """The newest buttons and diagnosis of each port: valid until replaced."""
        self._ending = False
        self._start_ns = monotonic_ns()
        self._thread = threading.Thread(target=self._run, name=f"device {name}", daemon=True)

    @property
    def now_ns(self) -> int:
        """Time since the thread's start."""
        return monotonic_ns() - self._start_ns

    def start(self, directory: Path) -> None:
        """Open the device and start reading; raises ParticipantError."""
        open_device(self._name, self._device, directory)
        self._start_ns = monotonic_ns()
        self._thread.start()

    def attach(self, uplink: Uplink | None) -> None:
        """Give samples from now on to `uplink`, and no more to the uplink before.

        The new uplink first gets the current buttons and diagnoses: changes may have come while no uplink was
        attached.
        """
        with self._attaching:
            self._uplink = uplink
            if uplink is not None and self._current:
                uplink.exchange(self.now_ns, list(self._current.values()))

    def unused_signals(self) -> Collection[str]:
        """Return the signals not used by the device now."""
        return self._device.unused()

    def write(self, port: str, value: Value) -> None:
        """Write to the device; may be called from any thread.

        Raises MessageError if the device refuses the value; all remaining errors end the thread.
        """
        try:
            self._device.write(port, value)
        except MessageError:
            raise
        except Exception as error:  # noqa: BLE001  # it is logged and reported
            self._fail(error)

    def _run(self) -> None:
        due_ns = self._start_ns
        try:
            while not self._ending:
                t = self.now_ns
                delayed = self._read(t)
                if self._start_ns + t >= due_ns:  # it was not read early
                    period_ns = min(self._period_ns, _LINK_NS) if delayed else self._period_ns
                    due_ns = max(due_ns + period_ns, self._start_ns + t)  # a late read is not caught up
                while not self._ending and (left_ns := due_ns - monotonic_ns()) > 0:
                    if self._device.wait(min(left_ns / 1e9, _LONGEST_SLEEP_S)):
                        break
        except Exception as error:  # noqa: BLE001  # it is logged and reported
            self._fail(error)

    def _read(self, t: int) -> bool:
        """Read the device and give the samples to the uplink; return whether a link delays anything."""
        samples = list(self._device.read(t))
        lasting = [
            sample
            for sample in samples
            if not isinstance(sample, VectorSample) and isinstance(sample.message, Joy | DiagnosticStatus)
        ]
        with self._attaching:
            self._current.update((sample.port, sample) for sample in lasting)
            return self._uplink is not None and self._uplink.exchange(t, samples)

    def _fail(self, error: Exception) -> None:
        if not self._ending:
            self._ending = True
            log.error("device '%s' has failed", self._name, exc_info=error)
            self._failed(self._name, f"{type(error).__name__}: {error}")

    def close(self) -> None:
        """End the thread and close the device."""
        self._ending = True
        if self._thread.is_alive():
            self._thread.join(timeout=2.0)
        close_device(self._name, self._device)
