"""The C interface of LibOVR 1.32: layouts, functions and values of OVR_CAPI.h for a head's pose.

The library is part of the Oculus (Meta Quest Link) application of Windows, is loaded from the application's
place, and is 64-bit. The additions of the SDK's own loader are made here: the flag RequestVersion and the
minor version, for the library's choice of layouts. Layouts of a size shown by a compiler are asserted below,
with 8-byte alignment on every platform. Convention cdecl.
"""

from __future__ import annotations

import ctypes
import sys
from ctypes import (
    POINTER,
    Structure,
    c_byte,
    c_char,
    c_char_p,
    c_double,
    c_float,
    c_int,
    c_int16,
    c_int32,
    c_uint32,
    c_void_p,
)
from functools import cache
from typing import Any

from schemas.errors import DeviceError

__all__ = [
    "INVISIBLE",
    "MINOR_VERSION",
    "ORIENTATION_TRACKED",
    "ORIGINS",
    "POSITION_TRACKED",
    "REQUEST_VERSION",
    "Api",
    "ErrorInfo",
    "HmdDesc",
    "InitParams",
    "PoseState",
    "SessionStatus",
    "TrackingState",
    "check",
    "default_library",
    "load",
]

MINOR_VERSION = 32
"""Minor version of the last SDK, 1.32."""
REQUEST_VERSION, INVISIBLE = 0x4, 0x10
"""Flags of ovrInitParams: use the minor version asked for; be a client not seen in the headset."""
ORIENTATION_TRACKED, POSITION_TRACKED = 0x1, 0x2
"""Status flags of ovrTrackingState."""
ORIGINS = {"eye": 0, "floor": 1}
"""ovrTrackingOrigin: height 0 is where the eyes were when the origin was set, or the floor."""


class _Vector(Structure):
    _fields_ = (("x", c_float), ("y", c_float), ("z", c_float))


class _Quaternion(Structure):
    _fields_ = (("x", c_float), ("y", c_float), ("z", c_float), ("w", c_float))


class _Pose(Structure):
    _fields_ = (("Orientation", _Quaternion), ("Position", _Vector))


class PoseState(Structure):
    """ovrPoseStatef."""

    _fields_ = (
        ("ThePose", _Pose),
        ("AngularVelocity", _Vector),
        ("LinearVelocity", _Vector),
        ("AngularAcceleration", _Vector),
        ("LinearAcceleration", _Vector),
        ("pad0", c_byte * 4),
        ("TimeInSeconds", c_double),
    )


class TrackingState(Structure):
    """ovrTrackingState."""

    _fields_ = (
        ("HeadPose", PoseState),
        ("StatusFlags", c_uint32),
        ("HandPoses", PoseState * 2),
        ("HandStatusFlags", c_uint32 * 2),
        ("CalibratedOrigin", _Pose),
    )


class InitParams(Structure):
    """ovrInitParams."""

    _fields_ = (
        ("Flags", c_uint32),
        ("RequestedMinorVersion", c_uint32),
        ("LogCallback", c_void_p),
        ("UserData", c_void_p),
        ("ConnectionTimeoutMS", c_uint32),
        ("pad0", c_byte * 4),
    )


class HmdDesc(Structure):
    """ovrHmdDesc."""

    _fields_ = (
        ("Type", c_int),
        ("pad0", c_byte * 4),
        ("ProductName", c_char * 64),
        ("Manufacturer", c_char * 64),
        ("VendorId", c_int16),
        ("ProductId", c_int16),
        ("SerialNumber", c_char * 24),
        ("FirmwareMajor", c_int16),
        ("FirmwareMinor", c_int16),
        ("Caps", c_uint32 * 4),
        ("DefaultEyeFov", c_float * 8),
        ("MaxEyeFov", c_float * 8),
        ("Resolution", c_int * 2),
        ("DisplayRefreshRate", c_float),
        ("pad1", c_byte * 4),
    )


class SessionStatus(Structure):
    """ovrSessionStatus; each is an ovrBool, a char."""

    _fields_ = tuple(
        (name, c_byte)
        for name in (
            "IsVisible",
            "HmdPresent",
            "HmdMounted",
            "DisplayLost",
            "ShouldQuit",
            "ShouldRecenter",
            "HasInputFocus",
            "OverlayPresent",
            "DepthRequested",
        )
    )


class ErrorInfo(Structure):
    """ovrErrorInfo."""

    _fields_ = (("Result", c_int32), ("ErrorString", c_char * 512))


_SIZES = {PoseState: 88, TrackingState: 312, InitParams: 32, HmdDesc: 264, SessionStatus: 9, ErrorInfo: 516}
for _layout, _size in _SIZES.items():
    assert ctypes.sizeof(_layout) == _size, (
        f"{_layout.__name__} has {ctypes.sizeof(_layout)} bytes, LibOVR's has {_size}: LibOVR needs a 64-bit"
        " Python"
    )

_SESSION = c_void_p
_FUNCTIONS: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "ovr_Initialize": (c_int32, (POINTER(InitParams),)),
    "ovr_Shutdown": (None, ()),
    "ovr_GetLastErrorInfo": (None, (POINTER(ErrorInfo),)),
    "ovr_GetVersionString": (c_char_p, ()),
    "ovr_Create": (c_int32, (POINTER(_SESSION), c_char_p)),
    "ovr_Destroy": (None, (_SESSION,)),
    "ovr_GetHmdDesc": (HmdDesc, (_SESSION,)),
    "ovr_GetSessionStatus": (c_int32, (_SESSION, POINTER(SessionStatus))),
    "ovr_SetTrackingOriginType": (c_int32, (_SESSION, c_int)),
    "ovr_RecenterTrackingOrigin": (c_int32, (_SESSION,)),
    "ovr_GetTrackingState": (TrackingState, (_SESSION, c_double, c_byte)),
}

Api = Any
"""The loaded library: functions by name, with types set."""


def default_library() -> str:
    """Return the library's name as used by the SDK's own loader."""
    return "LibOVRRT64_1.dll" if sys.platform == "win32" else "libOVRRT64.so.1"


@cache
def load(library: str) -> Api:
    """Return the library at this path, or of this name in the system's search path.

    A process loads a library once.

    Raises DeviceError for another library, or if loading fails.
    """
    try:
        api = ctypes.CDLL(library, winmode=0)  # 0: PATH, too, is searched, as the SDK's loader does
        for name, (result, arguments) in _FUNCTIONS.items():
            function = getattr(api, name)
            function.restype, function.argtypes = result, arguments
    except (OSError, AttributeError) as error:
        raise DeviceError(f"LibOVR cannot be loaded from '{library}' ({error})") from error
    return api


def check() -> tuple[bool, str, str]:
    """Return whether this machine has the library, the version, and the remedy: for `trocar doctor`."""
    remedy = "install the Oculus (Meta Quest Link) application (Windows)"
    try:
        return (
            True,
            f"{load(default_library()).ovr_GetVersionString().decode(errors='replace')}: headsets of Oculus",
            remedy,
        )
    except DeviceError as error:
        return False, str(error), remedy
