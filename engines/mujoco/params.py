"""What a scenario may say about the MuJoCo engine: the scene, and how it is stepped.

Lengths in m, angles in rad, quaternions (x, y, z, w), poses in the world unless a field says otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, ConfigDict, Field, GetPydanticSchema, field_validator, model_validator, with_config
from typing_extensions import TypedDict  # pydantic's wish before Python 3.12

from engines.mujoco.object_params import ObjectParams, TableParams
from hub.participant import Params
from robots.dvrk import ecm, psm
from robots.dvrk.instruments import Instrument, instrument
from robots.dvrk.parameters import HandPositions, MountedPositions, UnitQuaternion, home
from robots.serial_chain import Joint, SerialChain
from schemas.errors import MotionError
from schemas.keys import valid_name
from schemas.quantity import Angle, Duration, Length

__all__ = ["ArmParams", "EcmParams", "MujocoParams", "PsmParams", "SceneArm", "SceneParams", "SetupPositions"]

SceneArm = Literal["PSM1", "PSM2", "PSM3", "ECM"]
"""The arms of the patient's cart."""

SetupPositions = tuple[Length, Angle, Angle, Angle, Angle, Angle]
"""Of the setup joints that carry one arm: the lift (m), then five angles."""


def _check_range(q: tuple[float, ...], joints: tuple[Joint, ...]) -> None:
    if len(q) != len(joints):
        raise ValueError(f"{len(q)} joint positions, expected {len(joints)}: {', '.join(joint.name for joint in joints)}")
    for joint, value in zip(joints, q, strict=True):
        if not joint.lower <= value <= joint.upper:
            raise ValueError(f"{joint.name} {value:g} is out of its range {joint.lower:g} .. {joint.upper:g}")


class ArmParams(Params):
    """One arm: where it stands if it hangs on no setup joint."""

    position: tuple[Length, Length, Length] = Field(default=(0.0, 0.0, 0.0), description="of the remote centre of motion in the world")
    orientation: UnitQuaternion = Field(default=(0.0, 0.0, 0.0, 1.0), description="of the arm's base frame in the world: quaternion x, y, z, w")


class PsmParams(ArmParams):
    """A patient-side manipulator: what it holds and where it starts."""

    instrument: str = Field(default="palpation-probe", description="name or number, such as 400006")
    probe_radius: Length = Field(default=5e-3, gt=0.0, description="radius of the sphere of a palpation probe")
    start: MountedPositions = Field(default_factory=home, description=f"joint positions at time 0: {', '.join(psm.JOINT_NAMES)}, or as many as there are")
    jaw: Angle = Field(default=0.0, description="opening of the jaw at time 0")
    hand: HandPositions = Field(default=(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), description="closings, then spreads, of a hand's fingers at time 0; default: folded")

    @cached_property
    def tool(self) -> Instrument:
        """The instrument's numbers."""
        return instrument(self.instrument)

    @cached_property
    def chain(self) -> SerialChain:
        """The arm's kinematics, from `<arm>_base` to the tip."""
        return psm.chain(self.tool)

    @field_validator("instrument")
    @classmethod
    def _is_known(cls, name: str) -> str:
        try:
            snake = instrument(name).has_snake_wrist
        except MotionError as error:
            raise ValueError(str(error)) from error
        if snake:
            raise ValueError(f"'{name}' has a snake wrist, which the model cannot bend; take an 8 mm instrument such as 400006")
        return name

    @model_validator(mode="after")
    def _starts_in_range(self) -> Self:
        _check_range(self.start, self.chain.joints)
        jaw = self.tool.jaw
        if jaw is not None and not jaw.lower <= self.jaw <= jaw.upper:
            raise ValueError(f"jaw {self.jaw:g} is out of its range {jaw.lower:g} .. {jaw.upper:g}")
        if self.tool.hand is not None:
            _check_range(self.hand, self.tool.hand.joints)
        return self


class EcmParams(ArmParams):
    """The endoscope camera manipulator: which endoscope it holds and where it starts."""

    endoscope: Literal["straight", "up", "down"] = Field(default="straight", description="where it looks: along its shaft, or 30 degrees up or down")
    start: tuple[Angle, Angle, Length, Angle] = Field(default=ecm.HOME, description=f"joint positions at time 0: {', '.join(ecm.JOINT_NAMES)}")

    @model_validator(mode="after")
    def _starts_in_range(self) -> Self:
        _check_range(self.start, self.chain.joints)
        return self

    @cached_property
    def chain(self) -> SerialChain:
        """The arm's kinematics, from `ECM_base` to the camera frame."""
        return ecm.chain(self.endoscope)


@with_config(ConfigDict(extra="forbid"))
class _Arms(TypedDict, total=False):
    PSM1: PsmParams
    PSM2: PsmParams
    PSM3: PsmParams
    ECM: EcmParams


@with_config(ConfigDict(extra="forbid"))
class _SetupJoints(TypedDict, total=False):
    PSM1: SetupPositions
    PSM2: SetupPositions
    PSM3: SetupPositions
    ECM: SetupPositions


def _validated_as(form: Any) -> GetPydanticSchema:
    """Validate by `form`, whose keys each have a type of their own, what is typed as a mapping here."""
    return GetPydanticSchema(lambda _source, handler: handler(form))


def _object_names(objects: Mapping[str, ObjectParams]) -> Mapping[str, ObjectParams]:
    for name in objects:
        if not valid_name(name) or name in _Arms.__annotations__:
            raise ValueError(f"'{name}' is no name of an object: a letter, then letters, digits and underscores, and no arm's name")
    return objects


class SceneParams(Params):
    """What stands where: arms of a da Vinci Research Kit, a table and things to hold."""

    model: Literal["dvrk"] = "dvrk"
    arms: Annotated[dict[SceneArm, PsmParams | EcmParams], _validated_as(_Arms), Field(min_length=1)]
    mounting: Literal["free", "cart"] = Field(
        default="free", description="each arm where its position and orientation say, or on the setup joints of the cart, whose frame is the world then"
    )
    setup_joints: Annotated[dict[SceneArm, SetupPositions], _validated_as(_SetupJoints)] = Field(
        default_factory=dict[SceneArm, SetupPositions],
        description="where the braked setup joints are set; an arm that is not named has the simulated positions",
    )
    table: TableParams | None = None
    objects: Annotated[dict[str, ObjectParams], AfterValidator(_object_names)] = Field(default_factory=dict[str, ObjectParams])
    grasp: Literal["friction", "weld"] = Field(
        default="friction", description="what holds an object between two jaws: friction alone, or a weld as long as both touch it"
    )
    looks: bool = Field(default=True, description="give the robot its meshes; without, only what collides is there")

    @model_validator(mode="after")
    def _rolls_by_friction(self) -> Self:
        rolling = [name for name, arm in self.arms.items() if isinstance(arm, PsmParams) and arm.tool.roller is not None]
        if rolling and self.objects and self.grasp == "weld":
            raise ValueError(f"grasp: weld would hold what the instrument of {', '.join(rolling)} is to roll; take grasp: friction")
        return self


class MujocoParams(SceneParams):
    """A scene, and how it is stepped."""

    timestep: Duration = Field(default=500_000, gt=0, description="sub-step of the physics; divides the participant's period")
    publish_period: Duration = Field(
        default=5_000_000, gt=0, description="at which measured_cp, setpoint_js, qpos and the objects' poses are published; a multiple of the period"
    )
