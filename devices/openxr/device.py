"""A headset of any maker (kind `openxr`): the head's pose and velocity, no pictures."""

from __future__ import annotations

import os
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from devices.headset import Headset, HeadsetParams, Runtime
from schemas.errors import DeviceError, MissingExtraError

__all__ = ["OpenXr", "OpenXrParams", "check"]


class OpenXrParams(HeadsetParams):
    """Poses to read; the system chooses the runtime (on Linux also XR_RUNTIME_JSON)."""

    origin: Annotated[
        Literal["eye", "floor"],
        Field(description="where height 0 is: at the eyes (space LOCAL), or on the floor (space STAGE)"),
    ] = "eye"


class OpenXr(Headset):
    """Reads the present pose of the head from the OpenXR runtime."""

    params_model = OpenXrParams
    params: OpenXrParams

    def open(self, directory: Path) -> None:
        """Start. Raises MissingExtraError if pyopenxr is not installed."""
        super().open(directory)
        if find_spec("xr") is None:
            raise MissingExtraError(f"participant '{self.name}' (kind openxr)", "openxr", "pyopenxr")
        _silence_loader()

    def connect(self) -> Runtime:
        """Connect to the runtime. Raises DeviceError where there is none."""
        from devices.openxr.runtime import OpenXrRuntime

        return OpenXrRuntime(self.params.origin)


def _silence_loader() -> None:
    """Keep the loader from printing at every attempt; the diagnosis reports a failure once."""
    os.environ.setdefault("XR_LOADER_DEBUG", "none")


def check() -> tuple[bool, str, str]:
    """Return whether this machine has a usable runtime, its name, and the remedy, for `trocar doctor`."""
    if find_spec("xr") is None:
        return False, "pyopenxr is not installed", "pip install 'trocar[openxr]'"
    from devices.openxr.runtime import describe_missing, offered_extensions

    _silence_loader()
    remedy = "install SteamVR or Monado, and make it the system's active OpenXR runtime"
    try:
        problem = describe_missing(offered_extensions())
    except DeviceError as error:
        return False, str(error), remedy
    return (
        not problem,
        problem or "the active runtime gives poses without pictures: head-mounted displays",
        remedy,
    )
