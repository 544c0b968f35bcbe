"""Parameters of the clip-and-cut routine. SI units."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from controllers.cholecystectomy.routine_params import RoutineParams
from robots.dvrk.parameters import ArmName
from schemas.quantity import Duration, Force, Length
from schemas.scenario import Name

__all__ = ["ClipAndCutParams"]


class ClipAndCutParams(RoutineParams):
    """Arms and their instruments, names of the organs, and the limits of the routine."""

    applier: ArmName = Field(default="PSM1", description="the arm with the clip applier")
    scissors: ArmName = Field(default="PSM3", description="the arm with the scissors")
    tubes: tuple[Name, Name] = Field(
        default=("cystic_duct", "cystic_artery"),
        description="the organs that are clipped and cut, the first one first; left ends at the gallbladder",
    )
    avoid: tuple[Name, ...] = Field(
        default=(), max_length=16, description="organs that jaws and shafts keep away from where they can"
    )
    pull: tuple[Force, Force] = Field(
        default=(0.3, 1.0),
        description="least and largest pull at the gallbladder while the tubes are worked at",
    )
    farthest: Length = Field(
        default=20e-3, gt=0, le=0.1, description="longest way of the gallbladder when it is pulled aside"
    )
    reload: Duration = Field(
        default=1_000_000_000, ge=0, description="time for the next clip at the resting place"
    )
    attempts: int = Field(default=4, ge=1, le=20, description="most attempts at a sub-task")
    patience: Duration = Field(
        default=60_000_000_000, gt=0, description="longest time of a sub-task with all its attempts"
    )

    @model_validator(mode="after")
    def _is_a_team(self) -> Self:
        roles = (self.applier, self.grasper, self.scissors)
        self.check_roles(roles, self.pull)
        if len(set(roles)) < len(roles):
            raise ValueError(f"{', '.join(roles)}: applier, grasper and scissors are three arms")
        return self
