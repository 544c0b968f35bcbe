"""Parameters of the dVRK's console. SI units, radians."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from hub.participant import Params
from robots.dvrk.setup_joints import CartArm
from schemas.quantity import Power

__all__ = ["ComponentName", "DvrkConsoleParams", "GeneratorParams"]

ComponentName = Annotated[str, Field(pattern=r"^MTM[LR]_PSM[123]$")]
"""A master and its arm: `MTMR_PSM1`."""


class GeneratorParams(BaseModel):
    """The output of an electrosurgical generator for the instrument of an arm."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    pedal: Literal["coag", "bicoag"] = Field(
        default="coag", description="gives the power while pressed: coag for monopolar, bicoag for bipolar"
    )
    power: Power = Field(default=30.0, gt=0, le=400)


class DvrkConsoleParams(Params):
    """The arms, and the pairs of master and arm."""

    open_to_pages: ClassVar[bool] = True

    arms: tuple[CartArm, ...] = Field(
        min_length=1, description="simulated arms that `system/power_on`, `power_off` and `home` are for"
    )
    teleoperations: tuple[ComponentName, ...] = Field(
        default=(),
        description=(
            "a master and the arm that it leads, such as MTMR_PSM1; of those that share a master or an arm"
            " the first is selected at time 0"
        ),
    )
    energy: dict[CartArm, GeneratorParams] = Field(
        default={},
        description="generators of arms with energy instruments, led by pedals: outputs `<arm>/energy`, W",
    )
    scale: float = Field(
        default=0.2, gt=0.0, le=1.0, description="metres of the tip per metre of the master at time 0"
    )
    enabled: bool = Field(
        default=False,
        description=("whether teleoperation is enabled at time 0; on the real system it is not"),
    )
    operator_present: bool = Field(
        default=False, description="whether an operator's head is in the viewer at time 0"
    )
    align_mtm: bool = Field(
        default=True,
        description="masters are turned by their motors as the tips are before they lead; false for styluses",
    )

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if len(set(self.teleoperations)) < len(self.teleoperations):
            raise ValueError(f"a teleoperation is listed twice: {', '.join(self.teleoperations)}")
        for name in self.teleoperations:
            if (arm := name.partition("_")[2]) not in self.arms:
                raise ValueError(f"'{name}' leads {arm}, which is not among the arms: {', '.join(self.arms)}")
        return self
