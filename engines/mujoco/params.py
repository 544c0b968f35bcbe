"""What a scenario may say about the MuJoCo engine."""

from __future__ import annotations

from functools import cached_property
from typing import Literal

from pydantic import Field

from hub.participant import Params
from robots.dvrk import psm
from robots.dvrk.instruments import INSTRUMENTS, Instrument
from robots.dvrk.parameters import ArmName, PsmPositions, UnitQuaternion
from robots.serial_chain import SerialChain
from schemas.quantity import Duration, Length

__all__ = ["ArmParams", "MujocoParams"]


class ArmParams(Params):
    """One arm: what it holds, where it stands and where it starts."""

    instrument: Literal["palpation-probe"] = "palpation-probe"
    probe_radius: Length = Field(default=5e-3, gt=0.0, description="radius of the probe's sphere")
    position: tuple[Length, Length, Length] = Field(default=(0.0, 0.0, 0.0), description="of the remote centre of motion in the world")
    orientation: UnitQuaternion = Field(default=(0.0, 0.0, 0.0, 1.0), description="of the arm's base frame in the world: quaternion x, y, z, w")
    start: PsmPositions = Field(default=psm.HOME, description=f"joint positions at time 0: {', '.join(psm.JOINT_NAMES)}")

    @property
    def tool(self) -> Instrument:
        """The instrument's numbers."""
        return INSTRUMENTS[self.instrument]

    @cached_property
    def chain(self) -> SerialChain:
        """The arm's kinematics."""
        return psm.chain(self.tool)


class MujocoParams(Params):
    """A world with dVRK arms."""

    model: Literal["dvrk"] = "dvrk"
    arms: dict[ArmName, ArmParams] = Field(min_length=1)
    timestep: Duration = Field(default=500_000, gt=0, description="sub-step of the physics; divides the participant's period")
    publish_period: Duration = Field(default=5_000_000, gt=0, description="at which measured_cp and setpoint_js are published; a multiple of the period")
