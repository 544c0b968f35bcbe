"""Parameters of the haptic styluses of a host."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Self

from pydantic import Field, StringConstraints, model_validator

from devices.haptics.servo.params import ServoStylusParams
from hub.participant import Params
from schemas.quantity import Duration, Length

__all__ = ["StylusParams", "TouchParams"]


class StylusParams(ServoStylusParams):
    """A stylus on OpenHaptics."""

    tip_offset: Annotated[
        Length, Field(ge=0.0, le=0.2, description="from the centre of the gimbal to the tip")
    ] = 0.039
    """Offset of the tip; the default is from sawSensablePhantom (mtsSensableHD.cpp)."""


class TouchParams(Params):
    """The styluses of a host: a single process per host may use OpenHaptics."""

    native_code = ("library",)
    library: Annotated[
        Path | None,
        Field(
            description=(
                "libHD.so or hd.dll, relative to the scenario; default: where the vendor's installers put it"
            )
        ),
    ] = None
    styluses: Annotated[
        dict[Annotated[str, StringConstraints(pattern=r"^[A-Za-z]\w*$")], StylusParams],
        Field(min_length=1, description="by name: right, left"),
    ]
    max_age: Annotated[Duration, Field(gt=0, description="a pose or twist that is older is marked stale")] = (
        100_000_000
    )

    @model_validator(mode="after")
    def _each_has_its_own(self) -> Self:
        owners: dict[str | None, str] = {}
        for name, stylus in self.styluses.items():
            other = owners.setdefault(stylus.device, name)
            if other != name:
                what = "the default device" if stylus.device is None else f"'{stylus.device}'"
                raise ValueError(
                    f"'{other}' and '{name}' are both {what}; give each a 'device', its name in the vendor's"
                    " setup program"
                )
        return self
