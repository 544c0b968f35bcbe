"""A headset of Oculus (kind `libovr`): a client invisible to the wearer, reading poses only."""

from __future__ import annotations

from ctypes import byref, c_void_p, create_string_buffer
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from devices.diagnosis import Level
from devices.headset import Headset, HeadsetParams, HeadState, NoHead
from devices.libovr import api as ovr
from robots import rotation
from schemas.errors import DeviceError

__all__ = ["LibOvr", "LibOvrParams"]


class LibOvrParams(HeadsetParams):
    """Path of the library, and poses to read."""

    native_code = ("library",)
    library: Annotated[
        Path | None,
        Field(
            description=(
                "the LibOVR runtime, LibOVRRT64_1.dll; default: where the Oculus application has put it"
            )
        ),
    ] = None
    origin: Annotated[
        Literal["eye", "floor"], Field(description="where height 0 is: at the eyes, or on the floor")
    ] = "eye"
    recenter: Annotated[
        bool, Field(description="once, when the head is first tracked, make its place and heading the origin")
    ] = False
    angular_velocity: Annotated[
        Literal["base", "head"],
        Field(
            description=(
                "the axes along which the runtime gives the angular velocity; its header does not say, see"
                " docs/decisions/0023"
            )
        ),
    ] = "base"


class LibOvr(Headset):
    """Reads the newest state of the head from LibOVR."""

    params_model = LibOvrParams
    params: LibOvrParams

    def open(self, directory: Path) -> None:
        """Load the library if a path is given. Raises DeviceError on failure."""
        super().open(directory)
        if self.params.library:
            ovr.load(str(directory / self.params.library))
        self._library = str(directory / self.params.library) if self.params.library else ovr.default_library()

    def connect(self) -> _Session:
        """Initialise the runtime and make a session. Raises DeviceError without runtime or headset."""
        try:
            library = ovr.load(self._library)
        except DeviceError as error:
            raise DeviceError(
                f"{error}: install the Oculus (Meta Quest Link) application, or say where the library is"
                " (`library`)"
            ) from error
        return _Session(library, self.params)


class _Session:
    """A session with the runtime."""

    def __init__(self, api: ovr.Api, params: LibOvrParams) -> None:
        self._api, self._params = api, params
        self._handle = c_void_p()
        self._recenter = params.recenter
        asked = ovr.InitParams(
            Flags=ovr.REQUEST_VERSION | ovr.INVISIBLE, RequestedMinorVersion=ovr.MINOR_VERSION
        )
        self._check(
            api.ovr_Initialize(byref(asked)),
            "LibOVR does not start",
            "start the Oculus (Meta Quest Link) application",
        )
        try:
            luid = create_string_buffer(8)
            self._check(
                api.ovr_Create(byref(self._handle), luid),
                "there is no headset",
                "plug it in and switch it on",
            )
            self._check(
                api.ovr_SetTrackingOriginType(self._handle, ovr.ORIGINS[params.origin]),
                "the origin cannot be set",
                "check the Oculus application",
            )
        except DeviceError:
            self.close()
            raise
        found = api.ovr_GetHmdDesc(self._handle)
        model, serial = (text.decode(errors="replace") for text in (found.ProductName, found.SerialNumber))
        self.hardware = f"{model} {serial}".strip()

    def locate(self) -> HeadState | NoHead:
        status = ovr.SessionStatus()
        self._check(
            self._api.ovr_GetSessionStatus(self._handle, byref(status)),
            "the headset is lost",
            "plug it in again",
        )
        if status.DisplayLost or status.ShouldQuit:
            raise DeviceError("the Oculus application has ended the session")
        if not status.HmdPresent:
            return NoHead(Level.ERROR, "the headset is unplugged; plug it in again")
        if not status.HmdMounted:
            return NoHead(Level.WARN, "the headset is not worn and asleep; put it on")
        state = self._api.ovr_GetTrackingState(self._handle, 0.0, 0)  # time 0: the newest
        needed = ovr.ORIENTATION_TRACKED | ovr.POSITION_TRACKED
        if state.StatusFlags & needed != needed:
            return NoHead(
                Level.WARN, "the headset is not tracked; stay in sight of the sensors, with enough light"
            )
        if (self._recenter or status.ShouldRecenter) and self._api.ovr_RecenterTrackingOrigin(
            self._handle
        ) < 0:
            return NoHead(Level.WARN, "the origin cannot be taken; hold the head level for a moment")
        if self._recenter or status.ShouldRecenter:
            self._recenter = False
            state = self._api.ovr_GetTrackingState(self._handle, 0.0, 0)
        return self._head(state.HeadPose)

    def _head(self, head: ovr.PoseState) -> HeadState:
        q, p, v, w = (
            head.ThePose.Orientation,
            head.ThePose.Position,
            head.LinearVelocity,
            head.AngularVelocity,
        )
        orientation, angular = (q.x, q.y, q.z, q.w), (w.x, w.y, w.z)
        if self._params.angular_velocity == "head":
            x, y, z = (rotation.matrix(np.array(orientation)) @ angular).tolist()
            angular = (x, y, z)
        return HeadState(head.TimeInSeconds, (p.x, p.y, p.z), orientation, (v.x, v.y, v.z), angular)

    def _check(self, result: int, what: str, remedy: str) -> None:
        """Raise DeviceError, with the library's reason, if `result` is a failure (below 0)."""
        if result < 0:
            info = ovr.ErrorInfo()
            self._api.ovr_GetLastErrorInfo(byref(info))
            raise DeviceError(
                f"{what}; {remedy} (LibOVR: {info.ErrorString.decode(errors='replace') or 'no reason given'},"
                f" {result})"
            )

    def close(self) -> None:
        """End the session."""
        if self._handle:
            self._api.ovr_Destroy(self._handle)
        self._api.ovr_Shutdown()
