"""The endoscope camera manipulator in a scenario."""

from __future__ import annotations

from functools import cached_property
from typing import Self

from pydantic import Field, model_validator

from robots.dvrk import arm_bodies, drives, ecm, si
from robots.dvrk.mounted.mounted_arm import MountedArm, Published
from robots.dvrk.parameters import EcmPositions, check_start
from robots.serial_chain import SerialChain

__all__ = ["MountedEcm"]


class MountedEcm(MountedArm):
    """The endoscope camera manipulator: endoscope and start."""

    generation: si.Generation = Field(
        default="classic",
        description="of the da Vinci: si has the Si's ranges, efforts and gains, with the Classic's masses",
    )
    endoscope: ecm.Endoscope = Field(
        default="straight", description="where it looks: along its shaft, or 30 degrees up or down"
    )
    tip_frame: ecm.TipFrame = Field(
        default="kinematic",
        description=(
            "how the tip's frame stands about the shaft: as the roll link, or as the surgeon sees it, x to"
            " the left and y up"
        ),
    )
    start: EcmPositions = Field(
        default=ecm.HOME, description=f"joint positions at time 0: {', '.join(ecm.JOINT_NAMES)}"
    )

    @cached_property
    def chain(self) -> SerialChain:
        """The arm's kinematics, from `ECM_base` to the camera frame."""
        joints = ecm.JOINTS if self.generation == "classic" else si.ECM_JOINTS
        return ecm.chain(self.endoscope, self.tip_frame, joints)

    @property
    def _published(self) -> Published:
        return arm_bodies.ecm(), drives.ECM if self.generation == "classic" else drives.ECM_SI, ()

    @model_validator(mode="after")
    def _starts_in_range(self) -> Self:
        check_start(self.chain, self.start)
        return self
