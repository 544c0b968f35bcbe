"""A headset of any maker (kind `openxr`): the head's pose and velocity, no pictures."""

from __future__ import annotations

import os
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from devices.headset import Headset, HeadsetParams, Runtime
from schemas.errors import MissingExtraError

__all__ = ["OpenXr", "OpenXrParams"]


class OpenXrParams(HeadsetParams):
    """What the runtime is asked for; which runtime it is, the system says (on Linux also XR_RUNTIME_JSON)."""

    origin: Annotated[Literal["eye", "floor"], Field(description="where height 0 is: at the eyes (space LOCAL), or on the floor (space STAGE)")] = "eye"


class OpenXr(Headset):
    """Asks the OpenXR runtime where the head is now."""

    params_model = OpenXrParams
    params: OpenXrParams

    def open(self, directory: Path) -> None:
        """Begin anew. Raises MissingExtraError where pyopenxr is not installed."""
        super().open(directory)
        os.environ.setdefault("XR_LOADER_DEBUG", "none")  # what the loader would print at every try, the diagnosis says once
        if find_spec("xr") is None:
            raise MissingExtraError(f"participant '{self.name}' (kind openxr)", "openxr", "pyopenxr")

    def connect(self) -> Runtime:
        """Connect to the runtime. Raises DeviceError where there is none."""
        from devices.openxr.runtime import OpenXrRuntime

        return OpenXrRuntime(self.params.origin)
