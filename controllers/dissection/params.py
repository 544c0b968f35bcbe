"""Parameters of the dissection routine. SI units."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, model_validator

from controllers.cholecystectomy.routine_params import RoutineParams
from robots.dvrk.end_effectors.electrode import Electrode
from robots.dvrk.parameters import ArmName
from schemas.quantity import Duration, Force, Length, Power
from schemas.scenario import Name

__all__ = ["DissectionParams"]


class DissectionParams(RoutineParams):
    """Arms and their instruments, names in the tissue, and the limits of the routine."""

    hook: ArmName = Field(default="PSM1", description="the arm with the cautery hook")
    plate: Name = Field(default="cystic_plate", description="name of the attachment that is divided")
    avoid: tuple[Name, ...] = Field(
        default=("liver",), max_length=16, description="organs that the shaft of the hook keeps away from"
    )
    sheet: Name = Field(default="fat", description="name of the organ of fat that lies over the triangle")
    fat: tuple[Name, ...] = Field(
        default=("fat_gallbladder", "fat_cystic_duct", "fat_cystic_artery"),
        max_length=16,
        description=(
            "attachments of this organ that are cleared first, if the scene has them; the common duct need"
            " not be exposed"
        ),
    )
    spare: tuple[Name, ...] = Field(
        default=("common_bile_duct", "hepatic_artery"),
        max_length=16,
        description="organs near which the hook pulls without power, and the grasper takes no fat",
    )
    part: Literal["all", "lower third"] = Field(
        default="all",
        description="what is freed: the whole attachment, or its third nearest to its `lower_end`",
    )
    power: Power = Field(default=60.0, gt=0, le=400, description="power of the generator at the tissue")
    pull: tuple[Force, Force] = Field(
        default=(0.6, 1.5), description="least and largest pull at the gallbladder while the hook works"
    )
    farthest: Length = Field(
        default=60e-3, gt=0, le=0.2, description="longest way of the grasper from the place of its grasp"
    )
    attempts: int = Field(default=4, ge=1, le=20, description="most grasps, and most rounds without progress")
    patience: Duration = Field(
        default=10_000_000_000, gt=0, description="longest time with the hook at a place that does not part"
    )

    @model_validator(mode="after")
    def _is_a_pair(self) -> Self:
        self.check_roles((self.hook, self.grasper), self.pull)
        if self.hook == self.grasper:
            raise ValueError(f"{self.hook}: hook and grasper are two arms")
        if not isinstance(self.arms.present_arms[self.hook].end_effector, Electrode):
            raise ValueError(f"{self.hook} holds no cautery hook or spatula")
        return self
