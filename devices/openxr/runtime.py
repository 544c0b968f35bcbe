"""A session with an OpenXR runtime, without pictures: states, user presence, and the head's pose."""

from __future__ import annotations

from contextlib import suppress
from ctypes import POINTER, Structure, byref, cast
from typing import TypeVar

import xr

from devices.diagnosis import Level
from devices.headset import HeadState, NoHead
from devices.openxr import clock
from devices.vendor_axes import Vector3
from schemas.errors import DeviceError

__all__ = ["ORIGINS", "OpenXrRuntime", "describe_missing", "offered_extensions"]

HEADLESS, PRESENCE = "XR_MND_headless", "XR_EXT_user_presence"
"""Extensions: a session without graphics, required; events about wearing the headset, optional."""
ORIGINS = {"eye": xr.ReferenceSpaceType.LOCAL, "floor": xr.ReferenceSpaceType.STAGE}
_VALID = xr.SpaceLocationFlags.ORIENTATION_VALID_BIT | xr.SpaceLocationFlags.POSITION_VALID_BIT
"""Flags of a valid pose, without `tracked`: some runtimes, such as of simulated headsets, never set `tracked`
for the position.
"""
_Event = TypeVar("_Event", bound=Structure)


def offered_extensions() -> set[str]:
    """Return the names of the extensions of the system's active runtime.

    The runtime is loaded, not started.

    Raises DeviceError without a runtime.
    """
    try:
        return {
            extension.extension_name.decode() for extension in xr.enumerate_instance_extension_properties()
        }
    except xr.exception.XrException as error:
        raise _no_runtime_error(error) from error


def describe_missing(found: set[str]) -> str:
    """Return the missing parts of a runtime with extensions `found`; empty if enough for the head's pose."""
    missing = [name for name in (HEADLESS, clock.EXTENSION) if name not in found]
    return (
        f"this OpenXR runtime does not offer {' and '.join(missing)}, without which it cannot give a"
        " head's pose; use one that does, such as SteamVR or Monado, or kind 'libovr' for a headset of Oculus"
        if missing
        else ""
    )


class OpenXrRuntime:
    """An instance, a session and two spaces: the origin and the head."""

    def __init__(self, origin: str) -> None:
        """Connect to the runtime chosen by the system.

        Raises DeviceError if there is none, or no headset.
        """
        self._session: xr.Session | None = None
        self._instance = self._make_instance()
        self._running, self._present = False, True
        try:
            self._now = clock.runtime_clock(self._instance)
            system = xr.get_system(self._instance)
            names = (
                xr.get_instance_properties(self._instance).runtime_name,
                xr.get_system_properties(self._instance, system).system_name,
            )
            self.hardware = ", ".join(name.decode(errors="replace") for name in names)
            self._session = xr.create_session(self._instance, xr.SessionCreateInfo(system_id=system))
            self._base, self._head = (
                xr.create_reference_space(
                    self._session, xr.ReferenceSpaceCreateInfo(reference_space_type=kind)
                )
                for kind in (ORIGINS[origin], xr.ReferenceSpaceType.VIEW)
            )
        except xr.exception.XrException as error:
            self.close()
            raise DeviceError(
                f"there is no headset, or the OpenXR runtime refuses a session ({_describe_error(error)});"
                " plug it in and check the runtime"
            ) from error
        except DeviceError:
            self.close()
            raise

    @staticmethod
    def _make_instance() -> xr.Instance:
        found = offered_extensions()
        version = xr.Version(1, 0, 0)
        about = xr.ApplicationInfo(
            application_name="trocar",
            application_version=1,
            engine_name="trocar",
            engine_version=1,
            api_version=version,
        )
        enabled = [HEADLESS, clock.EXTENSION, *({PRESENCE} & found)]
        try:
            return xr.create_instance(
                xr.InstanceCreateInfo(application_info=about, enabled_extension_names=enabled)
            )
        # missing extensions are checked after the failure, because only a failure makes the loader look for
        # the active runtime again
        except xr.exception.XrException as error:
            raise (
                DeviceError(describe_missing(found)) if describe_missing(found) else _no_runtime_error(error)
            ) from error

    def locate(self) -> HeadState | NoHead:
        """Return the head's present state. Raises DeviceError if the runtime or the session is lost."""
        try:
            self._handle_events()
            if not self._running:
                return NoHead(
                    Level.WARN, "the OpenXR runtime has put the session to sleep; put the headset on"
                )
            if not self._present:
                return NoHead(Level.WARN, "the headset is not worn; put it on")
            return self._locate_head(self._now())
        except xr.TimeInvalidError:  # SteamVR, at the start (cmbruns/pyopenxr_examples, issue 12)
            return NoHead(Level.WARN, "the OpenXR runtime gives no time yet; wait, or restart it")
        except xr.exception.XrException as error:
            raise DeviceError(
                f"the OpenXR runtime or the headset is lost ({_describe_error(error)}); start it, plug it in"
            ) from error

    def _locate_head(self, now: int) -> HeadState | NoHead:
        velocity = xr.SpaceVelocity()
        location = xr.SpaceLocation(next=velocity)
        result = xr.check_result(xr.raw_functions.xrLocateSpace(self._head, self._base, now, byref(location)))
        if result.is_exception():
            raise result
        if location.location_flags & _VALID != _VALID:
            return NoHead(
                Level.WARN, "the headset is not tracked; stay in sight of the sensors, with enough light"
            )
        p, q = location.pose.position, location.pose.orientation
        linear = (
            _vector(velocity.linear_velocity)
            if velocity.velocity_flags & xr.SpaceVelocityFlags.LINEAR_VALID_BIT
            else None
        )
        angular = (
            _vector(velocity.angular_velocity)
            if velocity.velocity_flags & xr.SpaceVelocityFlags.ANGULAR_VALID_BIT
            else None
        )
        return HeadState(now * 1e-9, (p.x, p.y, p.z), (q.x, q.y, q.z, q.w), linear, angular)

    def _handle_events(self) -> None:
        while True:
            try:
                event = xr.poll_event(self._instance)
            except xr.EventUnavailable:
                return
            if event.type == xr.StructureType.EVENT_DATA_SESSION_STATE_CHANGED:
                self._change_to(_as_event(event, xr.EventDataSessionStateChanged).state)
            elif event.type == xr.StructureType.EVENT_DATA_USER_PRESENCE_CHANGED_EXT:
                self._present = bool(_as_event(event, xr.EventDataUserPresenceChangedEXT).is_user_present)
            elif event.type == xr.StructureType.EVENT_DATA_INSTANCE_LOSS_PENDING:
                raise DeviceError("the OpenXR runtime ends; start it again")

    def _change_to(self, state: xr.SessionState) -> None:
        """Handle a change of the session's state; in states not named here the session continues."""
        assert self._session is not None
        if state == xr.SessionState.READY:
            xr.begin_session(self._session, xr.SessionBeginInfo())
            self._running = True
        elif state == xr.SessionState.STOPPING:
            xr.end_session(self._session)
            self._running = False
        elif state in (xr.SessionState.LOSS_PENDING, xr.SessionState.EXITING):
            raise DeviceError(
                "the OpenXR runtime has ended the session; plug the headset in and check the runtime"
            )

    def close(self) -> None:
        """Destroy session and instance, as far as still existing."""
        with suppress(xr.exception.XrException):
            if self._session is not None:
                xr.destroy_session(self._session)
        with suppress(xr.exception.XrException):
            xr.destroy_instance(self._instance)


def _as_event(event: xr.EventDataBuffer, kind: type[_Event]) -> _Event:
    return cast(byref(event), POINTER(kind)).contents


def _vector(v: xr.Vector3f) -> Vector3:
    return v.x, v.y, v.z


def _no_runtime_error(error: xr.exception.XrException) -> DeviceError:
    return DeviceError(
        f"no OpenXR runtime answers ({_describe_error(error)}); start one, and make it the system's"
        " active one"
    )


def _describe_error(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"
