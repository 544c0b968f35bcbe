"""Parameters of gateways to ROS. SI units, radians, quaternions (x, y, z, w)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from devices.scene_arms import SceneArms
from hub.participant import Params
from robots.dvrk.crtk import Mounting, Reference
from schemas.files import find_file
from schemas.quantity import Duration

__all__ = ["GatewayParams", "Real", "TopicParams"]

Real = Literal["PSM1", "PSM2", "PSM3", "ECM", "MTML", "MTMR", "footpedals"]


class TopicParams(Params):
    """Topics of simulated arms, real arms and teleoperation components."""

    profile: Literal["dvrk", "vrep"] = Field(
        default="dvrk",
        description=(
            "topics of the real system, or of the authors' simulator, behind which a participant of kind"
            " `vrep` stands"
        ),
    )
    arms: SceneArms = Field(
        default=SceneArms(), description="the simulated arms, as in the motion controller"
    )
    listen: tuple[Real, ...] = Field(
        default=(),
        description=(
            "real arms: their states are received, and commands to them are sent; `footpedals`: the pedals"
            " are received instead of sent"
        ),
    )
    teleoperations: tuple[Annotated[str, Field(pattern=r"^MTM[LR]_(PSM[123]|ECM)$")], ...] = Field(
        default=(), description="teleoperation components of the console, such as MTMR_PSM1"
    )
    namespace: Annotated[str, Field(pattern=r"^([A-Za-z][A-Za-z0-9_]*(/[A-Za-z][A-Za-z0-9_]*)*)?$")] = Field(
        default="",
        description=(
            "prefix of every topic that is not of a real arm, so that simulation and real system share one"
            " graph"
        ),
    )

    @model_validator(mode="after")
    def _shown_or_listened_to(self) -> Self:
        both = sorted(set(self.arms.driven_arms) & set(self.listen))
        if both:
            raise ValueError(
                f"{', '.join(both)}: an arm is either simulated (`arms`) or real (`listen`); for both take"
                " two gateways, one with a `namespace`"
            )
        return self


class GatewayParams(TopicParams):
    """Simulated and real parts of the dVRK, and their publication."""

    mounting: Mounting = Field(default="free", description="as in the motion controller")
    reference: Reference = Field(default="camera", description="as in the motion controller")
    cameras: tuple[Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")], ...] = Field(
        default=("endoscope",), description="names of stereo cameras"
    )
    stitching: bool = Field(
        default=False,
        description="whether there are topics under /stitch, for a participant `guided-stitching`",
    )
    publish_period: Duration = Field(
        default=10_000_000,
        ge=500_000,
        description="of all states in wall time, whatever the step; 10 ms as on the dVRK",
    )
    robot_description: Path | None = Field(
        default=None,
        description="URDF file that is published as robot_description, as `trocar model export` writes it",
    )

    @field_validator("robot_description")
    @classmethod
    def _find(cls, file: Path | None, info: ValidationInfo) -> Path | None:
        if file is None:
            return None
        path = find_file(file, info)
        if not path.is_file():
            raise ValueError(f"no file '{path}'; `trocar model export` writes one")
        return path
