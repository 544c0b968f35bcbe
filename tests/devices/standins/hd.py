"""The other side of hd.c: orders to the styluses behind the stand-in of HDAPI, and the log of what they were
made to do.

Fields are those of `Device` in hd.c, axes and units HDAPI's where the name of a field is HDAPI's; `position`,
`target` and `amplitude` are in m.
"""

from __future__ import annotations

import ctypes
import mmap
import os
import select
from ctypes import c_char, c_double, c_int64
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["INKWELL", "NEEDS_MANUAL_INPUT", "NEEDS_UPDATE", "HdWorld", "Row"]

OK, NEEDS_UPDATE, NEEDS_MANUAL_INPUT = 0x5000, 0x5001, 0x5002
ENCODER_RESET, AUTO, INKWELL = 1, 2, 4
VARIABLE = "TROCAR_STANDIN_HD"

_ORDERS = (
    "plugged calibration calibration_at_power_on styles inkwell safety_switch buttons silent placeholder"
    " error error_frames"
)
_WHOLE = f"{_ORDERS} owner force_output updates last_style blocked"
_TRIPLES = ("motors", "target", "amplitude")
_REST = (
    "frequency turn_amplitude mass stiffness damping max_force max_continuous_force max_stiffness max_damping"
)


class Device(ctypes.Structure):
    _fields_ = (
        ("name", c_char * 64),
        *((name, c_int64) for name in _WHOLE.split()),
        *((name, c_double * 3) for name in _TRIPLES),
        *((name, c_double) for name in _REST.split()),
        ("position", c_double * 3),
        ("velocity", c_double * 3),
    )


class Row:
    """Columns of the log."""

    TIME, DEVICE, CALLBACK, GAP = range(4)
    FORCE, POSITION = slice(4, 7), slice(7, 10)
    LATE = 10


class HdWorld:
    """Two styluses, made as they are at first: plugged in, in need of an update of their calibration, held
    still at the origin.
    """

    def __init__(self, library: Path, file: Path) -> None:
        """Make the world of the stand-in `library` in `file`.

        Processes see it if the environment variable VARIABLE names the file.
        """
        self.file = file
        hd = ctypes.CDLL(str(library))
        hd.standin_size.restype = ctypes.c_long
        hd.standin_make.argtypes = [ctypes.c_void_p]
        size = hd.standin_size()
        with file.open("wb") as stream:
            stream.truncate(size)
        with file.open("r+b") as stream:
            self._memory = mmap.mmap(stream.fileno(), size)
        self.address = ctypes.addressof(c_char.from_buffer(self._memory))
        hd.standin_make(self.address)
        self._logged = c_int64.from_buffer(self._memory)
        self.devices: Any = (Device * 2).from_buffer(self._memory, 8)
        self._rows = np.frombuffer(self._memory, np.float64, offset=8 + ctypes.sizeof(self.devices)).reshape(
            -1, 12
        )
        assert self.devices[1].name == b"left", "hd.c and hd.py differ"

    def motors(self, device: int) -> tuple[float, float, float]:
        """Return the force (N) on a hand, as of its last frame, in HDAPI's axes."""
        return tuple(self.devices[device].motors)

    def rows(self, device: int = 0, since: float = 0.0) -> NDArray[np.float64]:
        """Return the log of one device from `since` (s of CLOCK_MONOTONIC) on, shape (n, 12); columns as in
        Row.
        """
        rows = self._rows[: self._logged.value]
        return rows[(rows[:, Row.DEVICE] == device) & (rows[:, Row.TIME] >= since)].copy()

    def release(self, device: int, owner: int, patience_s: float = 30.0) -> float:
        """Wait until `device` gives no force: the motors are at zero, or process `owner` has ended, which
        closes it. Return when, s of CLOCK_MONOTONIC. Raises TimeoutError after `patience_s`.
        """
        try:
            handle = os.pidfd_open(owner)
        except ProcessLookupError:  # it has ended, and its parent has seen so
            return monotonic()
        try:
            ended = select.poll()
            ended.register(handle, select.POLLIN)
            until = monotonic() + patience_s
            while not ended.poll(1) and any(self.motors(device)):
                if monotonic() > until:
                    raise TimeoutError(f"the motors give {self.motors(device)} N after {patience_s:g} s")
            return monotonic()
        finally:
            os.close(handle)
