"""Parameters of the needle tracker. SI units, radians."""

from __future__ import annotations

from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from controllers.motion.params import Arms, PsmParams, SetupJoints
from hub.participant import Params
from robots.dvrk import endoscope
from robots.dvrk.crtk import Mounting
from robots.dvrk.parameters import ArmName, UnitQuaternion
from robots.training.needles import DEFAULT, NeedleName
from schemas.quantity import Angle, Duration, Length

__all__ = ["HeldNeedleParams", "TrackerParams"]

_BASELINE = endoscope.BASELINE


class GraspParams(Params):
    """Where the needle's frame is in the gripper's, when the tracker starts, and how well known."""

    position: tuple[Length, Length, Length] = Field(description="of the arc's centre in the frame of the tip")
    orientation: UnitQuaternion = Field(description="of the needle's frame: quaternion x, y, z, w")
    position_deviation: Length = Field(
        default=1.5e-3, gt=0.0, description="standard deviation along each axis"
    )
    angle_deviation: Angle = Field(default=0.1, gt=0.0, description="standard deviation about each axis")


class DriftParams(Params):
    """How far a held needle may move in the gripper in a second: standard deviations."""

    position: Length = Field(default=0.2e-3, gt=0.0)
    angle: Angle = Field(default=0.01, gt=0.0)


class SlipParams(Params):
    """How far it may have moved when it has slipped: standard deviations."""

    position: Length = Field(default=2e-3, gt=0.0)
    angle: Angle = Field(default=0.35, gt=0.0, description="about the point where it is held")


class HeldNeedleParams(Params):
    """Base frames of the arms, and the needle in a gripper."""

    open_to_pages: ClassVar[bool] = True

    arms: Arms
    mounting: Mounting = "free"
    setup_joints: SetupJoints = SetupJoints()
    arm: ArmName = Field(default="PSM1", description="the one that holds the needle")
    needle: NeedleName = Field(default=DEFAULT, description="its size")


class TrackerParams(HeldNeedleParams):
    """Which needle, in which gripper, and what is known of both."""

    grasp: GraspParams
    drift: DriftParams = DriftParams()
    slip: SlipParams = SlipParams()
    baseline: Length = Field(default=_BASELINE, ge=0.0, description="distance of the two cameras")
    eyes: Literal["both", "left"] = Field(default="both", description="whose pictures are used")
    arc_noise: float = Field(
        default=0.5,
        gt=0.0,
        description="px, at each pixel of the wire's length: standard deviation, anew in each picture",
    )
    tip_noise: float = Field(default=0.5, gt=0.0, description="px: of the tip, likewise")
    lasting: float = Field(
        default=0.02,
        ge=0.0,
        description="px by which the wire is seen aside, alike in both eyes and for about a second",
    )
    shading: float = Field(
        default=0.04,
        ge=0.0,
        description="by which share of its width the lit side draws the whole wire aside, likewise",
    )
    capping: float = Field(
        default=0.1,
        ge=0.0,
        description="by which share of the wire's width the tip, in part hidden, is seen aside, likewise",
    )
    max_age: Duration = Field(
        default=200_000_000, gt=0, description="with no newer picture, the state is `blind`"
    )
    overlay: bool = Field(default=False, description="publish the left picture with what the tracker sees")

    @model_validator(mode="after")
    def _has_arms(self) -> Self:
        if missing := [arm for arm in (self.arm, "ECM") if arm not in self.arms.present_arms]:
            raise ValueError(
                f"arms: {', '.join(missing)} is missing: one holds the needle, the ECM the cameras"
            )
        return self

    @property
    def holder(self) -> PsmParams:
        """The arm that holds the needle."""
        held = self.arms.present_arms[self.arm]
        if not isinstance(held, PsmParams):
            raise TypeError(self.arm)
        return held
