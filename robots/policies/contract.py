"""The contract of a policy: what it sees and does, stated once in a scenario, for both sides.

scene:
  contract:
    arms: [PSM1]
    state: open-h-dvrk
    action: open-h-dvrk
    frame: base
    rate: 30
    horizon: 15
    cameras: {endoscope/left: {width: 224, height: 224, key: observation/image}}
    instruction: pick up the needle
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from robots.dvrk.crtk import Reference
from robots.dvrk.parameters import ArmName
from robots.policies.actions import ACTIONS, ActionName
from robots.policies.states import StateName

__all__ = ["CameraContract", "Contract"]

_CameraName = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]*(/[A-Za-z][A-Za-z0-9_-]*)*$")]


class CameraContract(BaseModel):
    """One camera."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    width: int = Field(default=224, ge=16, le=2048, description="pixels")
    height: int = Field(default=224, ge=16, le=2048, description="pixels")
    key: str = Field(
        default="",
        max_length=100,
        description="name of the picture on the policy's side; default: as the backend names it",
    )


class Contract(BaseModel):
    """Names, units, frames, sizes and rates between a session and a policy."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    arms: tuple[ArmName, ...] = Field(default=("PSM1",), min_length=1, description="in the rows' order")
    state: StateName = Field(
        default="open-h-dvrk",
        description="open-h-dvrk: pose and jaw of each arm; joint: joints and jaw; none: pictures alone",
    )
    action: ActionName = Field(
        default="open-h-dvrk",
        description=(
            "open-h-dvrk: set-point of pose and jaw; joint: of joints and jaw; cartesian-delta: displacement"
            " and rotation vector from row to row, and jaw; rel-xyz-rot6d: pose in the frame of the observed"
            " tip, and jaw"
        ),
    )
    frame: Reference = Field(
        default="camera",
        description="frame of poses: `reference` of the motion controller, or of the real arm",
    )
    rate: float = Field(default=30.0, gt=0.0, le=1000.0, description="rows of actions a second")
    horizon: int = Field(default=1, ge=1, le=1000, description="most rows in an answer")
    cameras: Mapping[_CameraName, CameraContract] = Field(
        default={}, max_length=8, description="pictures, in the order in which the backend names them"
    )
    instruction: str = Field(default="", max_length=1000, description="the task in words")

    @model_validator(mode="after")
    def _no_arm_twice(self) -> Self:
        if len(set(self.arms)) != len(self.arms):
            raise ValueError(f"arms: {', '.join(self.arms)} names an arm twice")
        return self

    @property
    def space(self) -> Literal["tip", "joint"]:
        """Whether goals are poses of the tip or joint positions."""
        return ACTIONS[self.action].space

    @property
    def row_ns(self) -> int:
        """Time from row to row, ns."""
        return round(1e9 / self.rate)
