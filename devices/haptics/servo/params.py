"""Parameters of haptic styluses held by the servo process."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from devices.haptics.params import SafetyParams
from devices.haptics.servo.driver import StylusSpec
from hub.participant import Params
from schemas.quantity import Length

__all__ = ["ServoStylusParams"]

_DEAD_MAN = "what must be held for force: the index of a button, or the safety switch of the stylus"


class ServoStylusParams(Params):
    """A stylus of the servo process."""

    device: Annotated[
        str | None,
        Field(
            min_length=1, description="its name in the vendor's setup program; default: the default device"
        ),
    ] = None
    dead_man: Annotated[
        Annotated[int, Field(ge=0, le=3)] | Literal["safety-switch"], Field(description=_DEAD_MAN)
    ] = 0
    tip_offset: Annotated[
        Length, Field(ge=0.0, le=0.2, description="from the centre of the gimbal to the tip")
    ] = 0.0
    safety: SafetyParams = SafetyParams()

    def spec(self, name: str) -> StylusSpec:
        """Return the stylus as described to the servo process."""
        return StylusSpec(name, self.device, self.dead_man, self.tip_offset)
