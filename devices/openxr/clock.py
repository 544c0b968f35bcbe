"""The runtime's time, given by OpenXR only through conversion of a clock of the operating system.

Each operating system has a separate extension for the conversion.
"""

from __future__ import annotations

import ctypes
import sys
import time
from collections.abc import Callable
from ctypes import CFUNCTYPE, POINTER, byref, c_int32, c_int64, c_long, c_void_p, cast
from typing import Any

import xr

from schemas.errors import DeviceError

__all__ = ["EXTENSION", "runtime_clock"]

if sys.platform == "win32":
    EXTENSION, _FUNCTION = (
        "XR_KHR_win32_convert_performance_counter_time",
        "xrConvertWin32PerformanceCounterToTimeKHR",
    )
else:
    EXTENSION, _FUNCTION = "XR_KHR_convert_timespec_time", "xrConvertTimespecTimeToTimeKHR"

_TIME_INVALID = -30
"""XR_ERROR_TIME_INVALID."""


class _Timespec(ctypes.Structure):
    _fields_ = (("tv_sec", c_int64), ("tv_nsec", c_long))


def _now() -> Any:
    """Return the system's clock: a count of the performance counter, or a timespec of the monotonic clock."""
    if sys.platform == "win32":
        count = c_int64()
        ctypes.windll.kernel32.QueryPerformanceCounter(byref(count))
        return count
    return _Timespec(*divmod(time.clock_gettime_ns(time.CLOCK_MONOTONIC), 1_000_000_000))


def runtime_clock(instance: xr.Instance) -> Callable[[], int]:
    """Return a function for the present time as an XrTime, ns.

    The instance must have been created with `EXTENSION`. The function raises TimeInvalidError if the
    runtime does not know the time yet, and DeviceError on failure.
    """
    prototype = CFUNCTYPE(c_int32, c_void_p, c_void_p, POINTER(c_int64))
    convert = prototype(cast(xr.get_instance_proc_addr(instance, _FUNCTION), c_void_p).value or 0)
    handle = cast(instance, c_void_p)

    def now() -> int:
        found = c_int64()
        result = convert(handle, byref(_now()), byref(found))
        if result == _TIME_INVALID or (not result and found.value <= 0):
            raise xr.TimeInvalidError
        if result:
            raise DeviceError(f"the OpenXR runtime gives no time ({_FUNCTION} returned {result}); restart it")
        return found.value

    return now
