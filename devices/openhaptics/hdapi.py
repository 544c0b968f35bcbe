"""HDAPI, the C interface of 3D Systems' OpenHaptics 3: functions, values and errors for a stylus.

The source is the public reference. The library is proprietary, comes with the driver or the SDK, and is
loaded from the installed place. Library and program need the same word size: the driver's hd.dll is 64-bit.
An unloaded library does not load again (CHAI3D, CPhantomDevices.cpp): a process loads the library once, and
a new process is the way to recover.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from ctypes import POINTER, Structure, c_char_p, c_double, c_int, c_ubyte, c_uint, c_ulong, c_ushort, c_void_p
from enum import IntEnum
from pathlib import Path
from typing import Any

from schemas.errors import DeviceError

__all__ = [
    "CALLBACK_CONTINUE",
    "CALLBACK_DONE",
    "FORCE_OUTPUT",
    "INVALID_HANDLE",
    "PLACEHOLDER_MM",
    "PRIORITY_MAX",
    "SCHEDULER_HERTZ",
    "SERVO_CALLBACK",
    "Calibration",
    "Code",
    "ErrorInfo",
    "Get",
    "Hdapi",
    "Style",
    "check",
    "errors",
    "find",
    "load",
]

INVALID_HANDLE = 0xFFFFFFFF
FORCE_OUTPUT = 0x4000
CALLBACK_DONE, CALLBACK_CONTINUE = 0, 1
PRIORITY_MAX = 65535
SCHEDULER_HERTZ = 1000

PLACEHOLDER_MM = (0.0, -110.0, -35.0)
"""Position, with joint angles of exactly 0, from a Touch owned by another process (hopezzzz/3dtouch, README).
"""


class Get:
    """Parameters of hdGet...v and hdSet...v (HD/hdDefines.h).

    Plain numbers: participants of an enumeration cost a servo callback a microsecond each.
    """

    BUTTONS = 0x2000
    SAFETY_SWITCH = 0x2001
    VELOCITY = 0x2051
    """mm/s, smoothed by the driver."""
    TRANSFORM = 0x2052
    """Sixteen doubles, column after column; the last column is the position in mm."""
    JOINT_ANGLES = 0x2100
    MODEL = 0x2501
    SERIAL_NUMBER = 0x2504
    CALIBRATION_STYLE = 0x2555
    MAX_STIFFNESS = 0x2602
    """Largest stiffness, N/mm (the reference says 0 to 1; the guide and devices in use have N/mm)."""
    MAX_FORCE = 0x2603
    MAX_DAMPING = 0x2609
    """N s/mm."""
    FORCE = 0x2700


class Calibration(IntEnum):
    """Answers of hdCheckCalibration."""

    OK = 0x5000
    NEEDS_UPDATE = 0x5001
    NEEDS_MANUAL_INPUT = 0x5002


class Style(IntEnum):
    """Bits of HD_CALIBRATION_STYLE, by preference: a Premium with two styles refuses the encoder reset."""

    AUTO = 2
    INKWELL = 4
    ENCODER_RESET = 1


class Code(IntEnum):
    """Error codes (HD/hdDefines.h)."""

    SUCCESS = 0
    INVALID_ENUM = 0x100
    INVALID_VALUE = 0x101
    INVALID_OPERATION = 0x102
    INVALID_INPUT_TYPE = 0x103
    BAD_HANDLE = 0x104
    WARM_MOTORS = 0x200
    EXCEEDED_MAX_FORCE = 0x201
    EXCEEDED_MAX_FORCE_IMPULSE = 0x202
    EXCEEDED_MAX_VELOCITY = 0x203
    FORCE_ERROR = 0x204
    DEVICE_FAULT = 0x300
    DEVICE_ALREADY_INITIATED = 0x301
    COMM_ERROR = 0x302
    COMM_CONFIG_ERROR = 0x303
    TIMER_ERROR = 0x304
    ILLEGAL_BEGIN = 0x400
    ILLEGAL_END = 0x401
    FRAME_ERROR = 0x402
    INVALID_PRIORITY = 0x500
    SCHEDULER_FULL = 0x501
    INVALID_LICENSE = 0x600

    @staticmethod
    def is_fault(code: int) -> bool:
        """Whether the device has failed, and the use must end."""
        return code & 0xF00 == 0x300

    @staticmethod
    def is_busy(code: int) -> bool:
        """Whether another program has the device."""
        return code in (Code.TIMER_ERROR, Code.DEVICE_ALREADY_INITIATED)

    @staticmethod
    def text(code: int) -> str:
        """Return the name of a code, as in the reference, and the number."""
        known = code in Code._value2member_map_
        return f"HD_{Code(code).name} (0x{code:04x})" if known else f"HDAPI error 0x{code:04x}"


class ErrorInfo(Structure):
    """HDErrorInfo, returned by hdGetError by value."""

    _fields_ = (("errorCode", c_uint), ("internalErrorCode", c_int), ("hHD", c_uint))


assert ctypes.sizeof(ErrorInfo) == 12

_library, _function = (
    (ctypes.WinDLL, ctypes.WINFUNCTYPE) if sys.platform == "win32" else (ctypes.CDLL, ctypes.CFUNCTYPE)
)
SERVO_CALLBACK = _function(c_uint, c_void_p)
"""HDSchedulerCallback: returns CALLBACK_CONTINUE or CALLBACK_DONE. The object must outlive the schedule."""

_FUNCTIONS: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "hdInitDevice": (c_uint, (c_char_p,)),
    "hdDisableDevice": (None, (c_uint,)),
    "hdMakeCurrentDevice": (None, (c_uint,)),
    "hdBeginFrame": (None, (c_uint,)),
    "hdEndFrame": (None, (c_uint,)),
    "hdGetError": (ErrorInfo, ()),
    "hdEnable": (None, (c_uint,)),
    "hdDisable": (None, (c_uint,)),
    "hdGetBooleanv": (None, (c_uint, POINTER(c_ubyte))),
    "hdGetIntegerv": (None, (c_uint, POINTER(c_int))),
    "hdGetDoublev": (None, (c_uint, POINTER(c_double))),
    "hdGetString": (c_char_p, (c_uint,)),
    "hdSetDoublev": (None, (c_uint, POINTER(c_double))),
    "hdCheckCalibration": (c_uint, ()),
    "hdUpdateCalibration": (None, (c_uint,)),
    "hdStartScheduler": (None, ()),
    "hdStopScheduler": (None, ()),
    "hdSetSchedulerRate": (None, (c_ulong,)),
    "hdScheduleAsynchronous": (c_ulong, (SERVO_CALLBACK, c_void_p, c_ushort)),
    "hdUnschedule": (None, (c_ulong,)),
}
"""Result and arguments; HDulong and HDSchedulerHandle are the platform's long: 4 bytes on Windows, 8 on
Linux.
"""

_SWITCHES = "hdGetBooleanv"
"""Function needed only for a switch as dead-man."""

_MOST_ERRORS = 64
"""Taken at a time, to bound the duration of a callback."""

Hdapi = Any
"""The loaded library: functions by name, with types set."""


def find(library: Path | None) -> Path:
    """Return the path of the library: `library`, or the place of the installers of 3D Systems.

    Raises DeviceError naming the places looked at.
    """
    places = [library] if library is not None else list(_places())
    for place in places:
        if place.is_file():
            return place.resolve()
    looked = ", ".join(f"'{place}'" for place in places)
    raise DeviceError(
        f"no library of OpenHaptics at {looked}. Install the Touch device driver and OpenHaptics of 3D"
        " Systems, or set 'library: PATH'"
    )


def check() -> tuple[bool, str, str]:
    """Return whether this machine has the library, where, and the remedy, for `trocar doctor`."""
    remedy = "install the Touch device driver and OpenHaptics of 3D Systems"
    try:
        return True, f"{find(None)}: haptic styluses of 3D Systems", remedy
    except DeviceError as error:
        return False, str(error).partition(". ")[0], remedy


def _places() -> Iterator[Path]:
    if sys.platform == "win32":
        vendor = Path(os.environ.get("PROGRAMW6432", r"C:\Program Files")) / "3D Systems"
        yield from (
            vendor / driver / "hd.dll" for driver in ("Touch Device Driver", "Phantom Device Drivers")
        )
        # the variable may be stale
        for base in (os.environ.get("OH_SDK_BASE"), r"C:\OpenHaptics\Developer\3.5.0"):
            if base:
                yield Path(base) / "lib" / "x64" / "Release" / "hd.dll"
        yield Path(os.environ.get("SYSTEMROOT", r"C:\Windows")) / "System32" / "hd.dll"
    else:
        named = os.environ.get("LD_LIBRARY_PATH", "").split(os.pathsep)
        yield from (
            Path(folder) / "libHD.so"
            for folder in (
                *filter(None, named),
                "/usr/lib",
                "/usr/lib64",
                "/usr/lib/x86_64-linux-gnu",
                "/usr/local/lib",
            )
        )


def load(path: Path) -> Hdapi:
    """Load the library. Raises DeviceError for another library, or if loading fails."""
    try:
        if sys.platform == "win32":
            os.add_dll_directory(str(path.parent))  # hd.dll needs its siblings
        hd = _library(str(path))
        for name, (result, arguments) in _FUNCTIONS.items():
            if name != _SWITCHES or hasattr(hd, name):
                function = getattr(hd, name)
                function.restype, function.argtypes = result, arguments
    except (OSError, AttributeError) as error:
        word = ctypes.sizeof(c_void_p) * 8
        raise DeviceError(
            f"OpenHaptics cannot be loaded from '{path}' ({error}); this Python has {word} bits, and so must"
            " the library"
        ) from error
    return hd


def errors(hd: Hdapi) -> list[tuple[int, int]]:
    """Take the errors off the library's stack; return (code, handle) of each, the newest first."""
    found: list[tuple[int, int]] = []
    for _ in range(_MOST_ERRORS):
        info = hd.hdGetError()
        if not info.errorCode:
            break
        found.append((info.errorCode, info.hHD))
    return found
