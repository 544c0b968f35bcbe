"""The limits of a force as a scenario states them: it may make each narrower, none wider."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from devices.haptics.limits import DeviceLimits, Limits
from hub.participant import Params
from schemas.errors import ScenarioError
from schemas.quantity import Damping, Duration, Force, Speed, Stiffness

__all__ = ["SafetyParams"]

_WIDEST = Limits()


class SafetyParams(Params):
    """Limits of the force on one hand. The defaults are the widest; what the device bears less than its limit is taken from the device."""

    force: Annotated[Force, Field(gt=0.0, le=_WIDEST.force, description="norm of the force, at most also 60 % of the device's nominal force")] = _WIDEST.force
    stiffness: Annotated[Stiffness, Field(gt=0.0, le=_WIDEST.stiffness, description="of all surfaces touched together")] = _WIDEST.stiffness
    damping: Annotated[Damping, Field(ge=0.0, le=_WIDEST.damping, description="the same")] = _WIDEST.damping
    slew: Annotated[Force, Field(gt=0.0, le=_WIDEST.slew, description="growth or turn of the force in one tick")] = _WIDEST.slew
    speed: Annotated[Speed, Field(gt=0.0, le=_WIDEST.speed, description="a faster hand gets no force until it lets go of the dead-man")] = _WIDEST.speed
    hold: Annotated[Duration, Field(gt=0, le=100_000_000, description="silence up to which the last contact model counts in full")] = 100_000_000
    decay: Annotated[Duration, Field(gt=0, le=20_000_000, description="time constant of the force's decay after that")] = 20_000_000
    silence: Annotated[Duration, Field(gt=0, le=150_000_000, description="silence after which there is no force")] = 150_000_000
    ramp: Annotated[Duration, Field(ge=1_000_000_000, description="time in which the force comes in after it was off")] = 1_000_000_000
    calm_force: Annotated[Force, Field(gt=0.0, le=_WIDEST.calm_force, description="the force comes in only after less than this was due")] = _WIDEST.calm_force
    calm_ticks: Annotated[int, Field(ge=_WIDEST.calm_ticks, description="for this number of ticks of the device")] = _WIDEST.calm_ticks
    passivity: Annotated[bool, Field(description="whether an observer watches the energy given to the hand, and brakes when it is too much")] = False

    @property
    def limits(self) -> Limits:
        """The limits as the haptic loop takes them, before the device has said what it bears."""
        return Limits(
            force=self.force,
            stiffness=self.stiffness,
            damping=self.damping,
            slew=self.slew,
            speed=self.speed,
            hold=self.hold * 1e-9,
            decay=self.decay * 1e-9,
            silence=self.silence * 1e-9,
            ramp=self.ramp * 1e-9,
            calm_force=self.calm_force,
            calm_ticks=self.calm_ticks,
        )

    def within(self, device: DeviceLimits) -> Limits:
        """Return the limits for `device`. Raises ScenarioError if the scenario asks for more than the device bears."""
        bearable = {"force": device.usable_force, "stiffness": device.stiffness, "damping": device.damping}
        for name in sorted(self.model_fields_set & bearable.keys()):
            if getattr(self, name) > bearable[name]:
                unit = {"force": "N", "stiffness": "N/m", "damping": "N s/m"}[name]
                asked, borne = f"{getattr(self, name):g} {unit}", f"{bearable[name]:g} {unit}"
                raise ScenarioError(f"safety.{name} is {asked}, but the device bears {borne}. A scenario may only lower a limit.", path=("safety", name))
        return self.limits.bounded(device)
