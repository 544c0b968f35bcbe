"""Parameters that every routine of the operation has. SI units."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from pydantic import Field

from controllers.motion.params import Arms, SetupJoints
from hub.participant import Params
from robots.dvrk.crtk import Mounting
from robots.dvrk.parameters import ArmName
from schemas.scenario import Name

__all__ = ["RoutineParams"]


class RoutineParams(Params):
    """Arms, the gallbladder, and the end."""

    open_to_pages: ClassVar[bool] = True

    arms: Arms
    mounting: Mounting = "free"
    setup_joints: SetupJoints = SetupJoints()
    grasper: ArmName = Field(default="PSM2", description="the arm that holds the gallbladder")
    gallbladder: Name = Field(default="gallbladder", description="name of the organ that is grasped")
    end: bool = Field(default=True, description="whether the session ends with the routine")

    def check_roles(self, roles: Sequence[ArmName], pull: tuple[float, float]) -> None:
        """Raise ValueError unless all arms are in the scene, and a pull is the least, then the largest."""
        if missing := [arm for arm in roles if arm not in self.arms.present_arms]:
            raise ValueError(f"{', '.join(missing)} is no arm of the scene")
        if not 0.0 <= pull[0] < pull[1]:
            raise ValueError(f"pull {list(pull)}: state the least, then the largest")
