"""Parameters of the motion controller. SI units, radians, quaternions (x, y, z, w)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal, NamedTuple, Self

from pydantic import Field, model_validator

from controllers.motion.equipment import endoscope_type
from controllers.motion.joint_errors import JointErrors
from hub.participant import Params
from robots.dvrk import ecm, mtm, psm
from robots.dvrk.crtk import Mounting, Reference
from robots.dvrk.mounted.mounted_arms import require_classic_cart
from robots.dvrk.mounted.mounted_ecm import MountedEcm
from robots.dvrk.mounted.mounted_mtm import MountedMtml, MountedMtmr
from robots.dvrk.mounted.mounted_psm import MountedPsm
from robots.dvrk.parameters import SetupPositions, settable
from robots.dvrk.setup_joints import CartArm, DrivenArm
from robots.dvrk.tool_type import tool_type
from robots.serial_chain import Joint
from schemas.quantity import Duration

__all__ = [
    "AnyParams",
    "Arms",
    "EcmParams",
    "Gripper",
    "MotionParams",
    "MtmlParams",
    "MtmrParams",
    "PsmParams",
    "SetupJoints",
]


class Gripper(NamedTuple):
    """The grasping part of an instrument."""

    name: str
    """Second part of the ports' names, such as `jaw`."""
    joints: tuple[Joint, ...]
    """Commanded joints: a jaw's angle, with the roller's angle if any, or closings of fingers."""
    start: tuple[float, ...]
    """Positions at time 0, rad."""


class PsmParams(MountedPsm):
    """A patient-side manipulator: instrument, and position before the first measurement."""

    @property
    def gripper(self) -> Gripper | None:
        """Grasping part of the instrument, or of the first spare that grasps; None: no instrument grasps."""
        effector = self.commanded_end_effector
        start = self.end_effector_start or (0.0,) * len(effector.joints)
        return Gripper(effector.name, effector.joints, start) if effector.joints else None

    @property
    def home(self) -> tuple[float, ...]:
        """Joint positions of the arm at home."""
        return psm.home(self.tool)

    @property
    def equipment(self) -> tuple[Literal["tool_type"], str]:
        """Equipment of the arm: event for the publication, and name."""
        return "tool_type", tool_type(self.tool)


class EcmParams(MountedEcm):
    """The endoscope camera manipulator: endoscope, and position before the first measurement."""

    @property
    def gripper(self) -> Gripper | None:
        """None: an endoscope does not grasp."""
        return None

    @property
    def home(self) -> tuple[float, ...]:
        """Joint positions of the arm at home."""
        return ecm.HOME

    @property
    def equipment(self) -> tuple[Literal["endoscope_type"], str]:
        """Equipment of the arm: event for the publication, and name."""
        return "endoscope_type", endoscope_type(self.endoscope)


class _Master:
    """Properties of a master for its controller."""

    @property
    def gripper(self) -> Gripper | None:
        """None: no motor drives the gripper of a master."""
        return None

    @property
    def home(self) -> tuple[float, ...]:
        """Joint positions of the arm at home."""
        return mtm.HOME

    @property
    def equipment(self) -> None:
        """None: a master holds nothing."""
        return None


class MtmlParams(_Master, MountedMtml):
    """The left master: place of the console, and position before the first measurement."""


class MtmrParams(_Master, MountedMtmr):
    """The right master."""


AnyParams = PsmParams | EcmParams | MtmlParams | MtmrParams


class Arms(Params):
    """The driven arms of cart and console."""

    PSM1: PsmParams | None = None
    PSM2: PsmParams | None = None
    PSM3: PsmParams | None = None
    ECM: EcmParams | None = None
    MTML: MtmlParams | None = None
    MTMR: MtmrParams | None = None

    @model_validator(mode="after")
    def _at_least_one(self) -> Self:
        if not self.driven_arms:
            raise ValueError("name at least one of PSM1, PSM2, PSM3, ECM, MTML, MTMR")
        return self

    @property
    def present_arms(self) -> Mapping[CartArm, PsmParams | EcmParams]:
        """Present arms of the cart by name."""
        named: dict[CartArm, PsmParams | EcmParams | None] = {
            "PSM1": self.PSM1,
            "PSM2": self.PSM2,
            "PSM3": self.PSM3,
            "ECM": self.ECM,
        }
        return {name: arm for name, arm in named.items() if arm is not None}

    @property
    def driven_arms(self) -> Mapping[DrivenArm, AnyParams]:
        """Present arms and masters by name."""
        named: dict[DrivenArm, AnyParams | None] = {"MTML": self.MTML, "MTMR": self.MTMR}
        return {**self.present_arms, **{name: arm for name, arm in named.items() if arm is not None}}


class SetupJoints(Params):
    """Positions of the braked setup joints: lift (m), then five angles; None: as simulated on the dVRK."""

    PSM1: Annotated[SetupPositions, settable("PSM1")] | None = None
    PSM2: Annotated[SetupPositions, settable("PSM2")] | None = None
    PSM3: Annotated[SetupPositions, settable("PSM3")] | None = None
    ECM: Annotated[SetupPositions, settable("ECM")] | None = None


class MotionParams(Params):
    """The driven arms, and the reference frame of their Cartesian ports."""

    open_to_pages: ClassVar[bool] = True

    arms: Arms
    mounting: Mounting = Field(
        default="free",
        description=(
            "each arm at its position and orientation, or on the setup joints of the cart, whose frame is"
            " then the world"
        ),
    )
    setup_joints: SetupJoints = SetupJoints()
    joint_errors: JointErrors = Field(
        default=JointErrors(), description="of the arms' encoders, of which the controller knows nothing"
    )
    reference: Reference = Field(
        default="camera",
        description=(
            "frame of measured_cp and of Cartesian commands: the camera view, as on the real system (the ECM"
            " itself: the cart; without an ECM: base), each arm's own base, or the world, where"
            " set_base_frame changes where a free arm's base stands"
        ),
    )
    initial_state: Literal["disabled", "homed"] = Field(
        default="disabled", description="operating state at time 0"
    )
    power_time: Duration = Field(
        default=100_000_000, ge=0, description="from `enable` to ENABLED; the real arm takes 3 s"
    )
    exchange_time: Duration = Field(
        default=5 * 10**9,
        ge=0,
        description=(
            "of an exchange of instruments, while the arm is empty; assumed, with an assistant who has the"
            " next instrument at hand"
        ),
    )
    publish_period: Duration = Field(
        default=10_000_000,
        gt=0,
        description=(
            "of all states but the commands to the robot, a multiple of the period; 10 ms as on the real"
            " system"
        ),
    )

    @model_validator(mode="after")
    def _stands_on_the_cart_of_the_classic(self) -> Self:
        if self.mounting == "cart":
            require_classic_cart(self.arms.present_arms)
        return self
