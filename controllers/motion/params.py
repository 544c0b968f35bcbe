"""What a scenario may say about the motion controller. SI units, radians, quaternions (x, y, z, w)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from hub.participant import Params
from robots.dvrk import ecm, psm
from robots.dvrk.instruments import Jaw, instrument
from robots.dvrk.parameters import EcmPositions, InstrumentName, PsmPositions, SetupPositions, UnitQuaternion, check_start, settable
from robots.dvrk.setup_joints import CartArm
from robots.serial_chain import SerialChain
from schemas.quantity import Angle, Duration, Length

__all__ = ["ArmParams", "Arms", "EcmParams", "MotionParams", "PsmParams", "SetupJoints"]


class ArmParams(Params):
    """One arm: where it stands if it hangs on no setup joint."""

    position: tuple[Length, Length, Length] = Field(default=(0.0, 0.0, 0.0), description="of the remote centre of motion in the world")
    orientation: UnitQuaternion = Field(default=(0.0, 0.0, 0.0, 1.0), description="of the arm's base frame in the world: quaternion x, y, z, w")


class PsmParams(ArmParams):
    """A patient-side manipulator: what it holds, and where it is until it is measured."""

    instrument: InstrumentName = Field(default="palpation-probe", description="name or number, such as 400006")
    start: PsmPositions = Field(default=psm.HOME, description=f"joint positions at time 0: {', '.join(psm.JOINT_NAMES)}")
    jaw: Angle = Field(default=0.0, description="opening of the jaw at time 0")

    @model_validator(mode="after")
    def _starts_in_range(self) -> Self:
        check_start(self.chain, self.start, self.gripper, self.jaw)
        return self

    @property
    def chain(self) -> SerialChain:
        """The arm's kinematics, from `<arm>_base` to the tip."""
        return psm.chain(instrument(self.instrument))

    @property
    def gripper(self) -> Jaw | None:
        """The instrument's jaw, if it has one."""
        return instrument(self.instrument).jaw

    @property
    def home(self) -> tuple[float, ...]:
        """Where the arm goes to be homed."""
        return psm.HOME


class EcmParams(ArmParams):
    """The endoscope camera manipulator: which endoscope it holds, and where it is until it is measured."""

    endoscope: ecm.Endoscope = Field(default="straight", description="where it looks: along its shaft, or 30 degrees up or down")
    tip_frame: ecm.TipFrame = Field(
        default="kinematic", description="how the tip's frame stands about the shaft: as the roll link, or as the surgeon sees it, x to the left and y up"
    )
    start: EcmPositions = Field(default=ecm.HOME, description=f"joint positions at time 0: {', '.join(ecm.JOINT_NAMES)}")

    @model_validator(mode="after")
    def _starts_in_range(self) -> Self:
        check_start(self.chain, self.start)
        return self

    @property
    def chain(self) -> SerialChain:
        """The arm's kinematics, from `ECM_base` to the camera frame."""
        return ecm.chain(self.endoscope, self.tip_frame)

    @property
    def gripper(self) -> Jaw | None:
        """None: an endoscope has no jaw."""
        return None

    @property
    def home(self) -> tuple[float, ...]:
        """Where the arm goes to be homed."""
        return ecm.HOME


class Arms(Params):
    """The arms of a patient cart that are driven."""

    PSM1: PsmParams | None = None
    PSM2: PsmParams | None = None
    PSM3: PsmParams | None = None
    ECM: EcmParams | None = None

    @model_validator(mode="after")
    def _at_least_one(self) -> Self:
        if not self.driven:
            raise ValueError("name at least one of PSM1, PSM2, PSM3, ECM")
        return self

    @property
    def driven(self) -> Mapping[CartArm, PsmParams | EcmParams]:
        """Those that are there, by name."""
        named: dict[CartArm, PsmParams | EcmParams | None] = {"PSM1": self.PSM1, "PSM2": self.PSM2, "PSM3": self.PSM3, "ECM": self.ECM}
        return {name: arm for name, arm in named.items() if arm is not None}


class SetupJoints(Params):
    """Where the braked setup joints are set: the lift (m), then five angles; None: the simulated positions."""

    PSM1: Annotated[SetupPositions, settable("PSM1")] | None = None
    PSM2: Annotated[SetupPositions, settable("PSM2")] | None = None
    PSM3: Annotated[SetupPositions, settable("PSM3")] | None = None
    ECM: Annotated[SetupPositions, settable("ECM")] | None = None


class MotionParams(Params):
    """Which arms are driven, and in which frame the world outside speaks of them."""

    arms: Arms
    mounting: Literal["free", "cart"] = Field(
        default="free", description="each arm where its position and orientation say, or on the setup joints of the cart, whose frame is the world then"
    )
    setup_joints: SetupJoints = SetupJoints()
    reference: Literal["camera", "base"] = Field(
        default="camera",
        description="frame of measured_cp and of Cartesian commands: the camera view, as on the real system (the ECM itself: the cart; without an ECM: base),"
        " or each arm's own base",
    )
    initial_state: Literal["disabled", "homed"] = Field(default="disabled", description="operating state at time 0")
    power_time: Duration = Field(default=100_000_000, ge=0, description="from `enable` to ENABLED; the real arm takes 3 s")
    publish_period: Duration = Field(
        default=10_000_000, gt=0, description="of all states but the commands to the robot, a multiple of the period; 10 ms as on the real system"
    )
