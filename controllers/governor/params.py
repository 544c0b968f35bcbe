"""Parameters of the governor."""

from __future__ import annotations

from math import radians
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from controllers.motion.params import Arms, PsmParams
from hub.participant import Params
from robots.dvrk.crtk import Mounting
from robots.dvrk.parameters import ArmName
from robots.policies.contract import Contract
from schemas.quantity import Angle, Duration, Force, Length, Speed

__all__ = ["GovernorParams"]

_Point = tuple[Length, Length, Length]
_Corners = tuple[_Point, _Point]


class GovernorParams(Params):
    """Contract with the policy, execution of its answers, and limits."""

    open_to_pages: ClassVar[bool] = True

    arms: Arms
    mounting: Mounting = "free"
    contract: Contract = Contract()
    execution: Literal["receding-horizon", "temporal-ensembling"] = Field(
        default="receding-horizon",
        description="follow the newest answer, or the mean of all answers for an instant, older ones first",
    )
    execute: int = Field(
        default=1, ge=1, le=1000, description="rows from one observation to the next; at most the horizon"
    )
    workspace: dict[ArmName, _Corners] = Field(
        default_factory=dict[ArmName, _Corners],
        description=(
            "two opposite corners of a box for each tip, in the contract's frame; goals outside are moved to"
            " the box, joint goals outside are not taken"
        ),
    )
    speed: Annotated[Speed, Field(gt=0.0, le=1.0)] = Field(default=0.1, description="most of a tip")
    turn_speed: Annotated[Angle, Field(gt=0.0, le=20.0)] = Field(
        default=radians(180.0), description="most of a tip, in a second"
    )
    jaw_speed: Annotated[Angle, Field(gt=0.0, le=20.0)] = Field(
        default=radians(180.0), description="most of a jaw, in a second"
    )
    jaw: tuple[Angle, Angle] | None = Field(
        default=None, description="least and largest opening; default: the instrument's range"
    )
    force: Annotated[Force, Field(gt=0.0)] | None = Field(
        default=None, description="at the tip, above which the arms hold, until it is below four fifths of it"
    )
    silence: Duration = Field(
        default=200_000_000,
        gt=0,
        description="the arms hold when the rows of the last answer ended longer ago",
    )
    disagreement: Annotated[Length, Field(gt=0.0)] = Field(
        default=0.02,
        description=(
            "the arms hold when two successive answers put a tip farther apart at one instant that is to be"
            " executed, until two agree"
        ),
    )
    max_age: Duration = Field(
        default=100_000_000, gt=0, description="the arms hold when a real arm has been silent for longer"
    )

    @model_validator(mode="after")
    def _fits_the_arms(self) -> Self:
        present = self.arms.present_arms
        for arm in self.contract.arms:
            held = present.get(arm)
            if held is None:
                raise ValueError(
                    f"contract.arms: {arm} is no arm of the scene, which has {', '.join(present)}"
                )
            if not isinstance(held, PsmParams) or held.gripper is None or held.gripper.name != "jaw":
                raise ValueError(f"contract.arms: {arm} holds no instrument with a jaw")
        if strangers := [arm for arm in self.workspace if arm not in self.contract.arms]:
            raise ValueError(f"workspace: {', '.join(strangers)} is no arm of the contract")
        if self.execute > self.contract.horizon:
            raise ValueError(
                f"execute: {self.execute} rows from one observation to the next, but an answer has"
                f" {self.contract.horizon} (contract.horizon)"
            )
        return self
