"""The limits of a force in a scenario; a scenario may make a limit narrower, never wider."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from devices.haptics.limits import DeviceLimits, Limits
from hub.participant import Params
from schemas.errors import ScenarioError
from schemas.quantity import Damping, Duration, Force, Speed, Stiffness

__all__ = ["SafetyParams"]

_WIDEST = Limits()
_HOLD_NS, _DECAY_NS, _SILENCE_NS, _RAMP_NS = (
    round(s * 1e9) for s in (_WIDEST.hold, _WIDEST.decay, _WIDEST.silence, _WIDEST.ramp)
)


class SafetyParams(Params):
    """Limits of the force on a hand.

    The defaults are the widest; for the first three, lower limits of the device take precedence.
    """

    force: Annotated[Force, Field(gt=0.0, le=_WIDEST.force)] | None = Field(
        default=None,
        description=(
            "norm of the force; default: 2 N or 60 % of the device's nominal force, whichever is less"
        ),
    )
    stiffness: Annotated[Stiffness, Field(gt=0.0, le=_WIDEST.stiffness)] | None = Field(
        default=None,
        description="of all surfaces touched together; default: 400 N/m or the device's, whichever is less",
    )
    damping: Annotated[Damping, Field(ge=0.0, le=_WIDEST.damping)] | None = Field(
        default=None,
        description="of all surfaces touched together; default: 4 N s/m or the device's, whichever is less",
    )
    slew: Force = Field(
        default=_WIDEST.slew, gt=0.0, le=_WIDEST.slew, description="growth or turn of the force in one tick"
    )
    speed: Speed = Field(
        default=_WIDEST.speed,
        gt=0.0,
        le=_WIDEST.speed,
        description="a faster hand gets no force until it releases the dead-man",
    )
    hold: Duration = Field(
        default=_HOLD_NS,
        gt=0,
        le=_HOLD_NS,
        description="silence up to which the last contact model has its full force",
    )
    decay: Duration = Field(
        default=_DECAY_NS, gt=0, le=_DECAY_NS, description="time constant of the force's decay after that"
    )
    silence: Duration = Field(
        default=_SILENCE_NS, gt=0, le=_SILENCE_NS, description="silence after which there is no force"
    )
    ramp: Duration = Field(
        default=_RAMP_NS, ge=_RAMP_NS, description="time in which the force rises after it was off"
    )
    calm_force: Force = Field(
        default=_WIDEST.calm_force,
        gt=0.0,
        le=_WIDEST.calm_force,
        description="the force rises only after less than this was due",
    )
    calm_ticks: int = Field(
        default=_WIDEST.calm_ticks,
        ge=_WIDEST.calm_ticks,
        description="for this number of ticks of the device",
    )
    passivity: bool = Field(
        default=False,
        description=("whether an observer sums the energy given to the hand, and damps when it is too much"),
    )

    def within(self, device: DeviceLimits) -> Limits:
        """Return the limits for the haptic loop.

        Raises ScenarioError if the scenario states more than the device's limits.
        """
        for name, stated, most, unit in (
            ("force", self.force, device.usable_force, "N"),
            ("stiffness", self.stiffness, device.stiffness, "N/m"),
            ("damping", self.damping, device.damping, "N s/m"),
        ):
            if stated is not None and stated > most:
                problem = (
                    f"safety.{name} is {stated:g} {unit}, but the device's limit is {most:g} {unit}. A"
                    " scenario may only lower a limit."
                )
                raise ScenarioError(problem, path=("safety", name))
        return Limits(
            force=_WIDEST.force if self.force is None else self.force,
            stiffness=_WIDEST.stiffness if self.stiffness is None else self.stiffness,
            damping=_WIDEST.damping if self.damping is None else self.damping,
            slew=self.slew,
            speed=self.speed,
            hold=self.hold * 1e-9,
            decay=self.decay * 1e-9,
            silence=self.silence * 1e-9,
            ramp=self.ramp * 1e-9,
            calm_force=self.calm_force,
            calm_ticks=self.calm_ticks,
        ).bound_by(device)
