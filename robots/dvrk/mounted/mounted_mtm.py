"""Masters of the surgeon's console in a scenario."""

from __future__ import annotations

from functools import cached_property
from math import radians
from typing import ClassVar, Self

from pydantic import Field, model_validator

from robots.dvrk import arm_bodies, drives, mtm
from robots.dvrk.end_effectors.master_gripper import MasterGripper
from robots.dvrk.hand_on_master import HandOnMaster
from robots.dvrk.mounted.mounted_arm import MountedArm, Published
from robots.dvrk.parameters import MtmPositions, UnitQuaternion, check_start
from robots.serial_chain import SerialChain
from schemas.quantity import Angle, Length
from schemas.vectors import Vector

__all__ = ["MountedMtm", "MountedMtml", "MountedMtmr"]


class MountedMtm(MountedArm):
    """A master at the surgeon's console: where the stereo viewer stands, and start."""

    position: tuple[Length, Length, Length] = Field(
        default=(-1.9, 0.9, 0.95), description="of the stereo viewer (HRSV) in the world; the same for both"
    )
    orientation: UnitQuaternion = Field(
        default=(0.6830127018922194, 0.6830127018922194, 0.1830127018922193, 0.1830127018922193),
        description=(
            "of the stereo viewer in the world, x to the left of the surgeon, y up, z ahead in the picture:"
            " quaternion x, y, z, w"
        ),
    )
    start: MtmPositions = Field(
        default=mtm.HOME, description=f"joint positions at time 0: {', '.join(mtm.JOINT_NAMES)}"
    )
    opening: Angle = Field(
        default=radians(30.0), ge=0.0, le=mtm.GRIPPER_OPEN, description="opening of the gripper at time 0"
    )

    hand: HandOnMaster = Field(default=HandOnMaster(), description="how firmly a hand holds the gripper")

    side: ClassVar[mtm.MtmName]
    """Name of the arm."""

    @property
    def viewer_pose(self) -> Vector:
        """Pose of the stereo viewer in the world, shape (4, 4)."""
        return super().pose

    @property
    def pose(self) -> Vector:
        """Pose of the base frame in the world, shape (4, 4)."""
        return self.viewer_pose @ mtm.BASE[self.side]

    @cached_property
    def chain(self) -> SerialChain:
        """The arm's kinematics, from `<arm>_base` to the gripper."""
        return mtm.chain(self.side)

    @property
    def end_effector(self) -> MasterGripper:
        """The gripper."""
        return MasterGripper()

    @property
    def end_effector_start(self) -> tuple[float, ...]:
        """Opening of the gripper at time 0."""
        return (self.opening,)

    @property
    def _published(self) -> Published:
        fingers = {motor.name: motor.drive for motor in self.end_effector.motors}
        return arm_bodies.mtm(), {**drives.MTM, **fingers}, ()

    @model_validator(mode="after")
    def _starts_in_range(self) -> Self:
        check_start(self.chain, self.start)
        return self


class MountedMtml(MountedMtm):
    """The left master."""

    side: ClassVar[mtm.MtmName] = "MTML"


class MountedMtmr(MountedMtm):
    """The right master."""

    side: ClassVar[mtm.MtmName] = "MTMR"
