"""Parameters of lens and sensor of an endoscope."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from hub.participant import Params

__all__ = ["SensorParams"]


class SensorParams(Params):
    """Lens and sensor with endoscope looks.

    All off: `automatic_light: false`, `tone: linear`, `vignette: 0`, `noise: 0`.
    """

    automatic_light: bool = Field(
        default=True, description="the lamp is dimmed until tissue has a fixed mean brightness"
    )
    exposure: float = Field(default=0.0, ge=-6.0, le=6.0, description="in stops: 1 doubles the light")
    tone: Literal["filmic", "linear"] = Field(
        default="filmic", description="how bright light is compressed; linear: highlights are cut off"
    )
    vignette: float = Field(
        default=0.35, ge=0.0, le=1.0, description="loss of light in the corners of a picture; 0: none"
    )
    noise: float = Field(
        default=1.0, ge=0.0, le=20.0, description="shot and read noise, 1: of a usual camera head; 0: none"
    )
