"""Parameters of lens and sensor of an endoscope."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from hub.participant import Params
from schemas.quantity import Duration, Length

__all__ = ["LensEvent", "SensorParams"]


class LensEvent(Params):
    """A change of what is on the lens."""

    time: Duration = Field(ge=0, description="simulated time at which it begins")
    duration: Duration = Field(default=0, ge=0, description="time until it is complete")
    fog: float | None = Field(default=None, ge=0.0, le=1.0, description="afterwards; default: as before")
    dirt: float | None = Field(default=None, ge=0.0, le=1.0, description="afterwards; default: as before")


class SensorParams(Params):
    """Lens and sensor with endoscope looks.

    All off: `automatic_light: false`, `tone: linear`, `vignette: 0`, `noise: 0`; the others are off unless
    they are stated.
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
    white_balance: Literal["fixed", "automatic"] = Field(
        default="fixed",
        description=(
            "fixed: as set on a white sheet before the operation; automatic: the mean of a picture is drawn"
            " towards grey, with a lag"
        ),
    )
    warmth: float = Field(
        default=0.0, ge=-1.0, le=1.0, description="error of the white balance; 1: red over blue is doubled"
    )
    fog: float = Field(
        default=0.0, ge=0.0, le=1.0, description="water on a cold lens at the start; 1: no sight"
    )
    dirt: float = Field(
        default=0.0, ge=0.0, le=1.0, description="share of smears and drops on the lens at the start"
    )
    events: tuple[LensEvent, ...] = Field(
        default=(), max_length=100, description="later changes of fog and dirt, such as a wipe"
    )
    focus: Length | None = Field(
        default=None,
        gt=0.0,
        description="distance in focus; default: sharp everywhere, as an endoscope is from 30 to 150 mm",
    )
    aperture: Length = Field(
        default=4e-4,
        gt=0.0,
        le=0.01,
        description="diameter of the lens's opening with a `focus`: the larger, the less is sharp; assumed",
    )
    compression: int | None = Field(
        default=None,
        ge=1,
        le=95,
        description="quality of the JPEG that the picture was before, as of a video link; default: none",
    )
