"""Parameters of the MuJoCo engine: scene and stepping.

Lengths in m, angles in rad, quaternions (x, y, z, w), poses in the world unless a field says otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Field,
    GetPydanticSchema,
    model_validator,
    with_config,
)
from typing_extensions import TypedDict  # pydantic needs this one before Python 3.12

from engines.mujoco.object_params import ObjectParams, TableParams
from engines.mujoco.tools import instrument_tools
from hub.participant import Params, Tool, ToolParams
from robots.dvrk.end_effectors.rolling_jaw import RollingJaw
from robots.dvrk.mounted.mounted_arms import AnyArm, MountedArms, require_classic_cart
from robots.dvrk.mounted.mounted_mtm import MountedMtm
from robots.dvrk.mounted.mounted_psm import MountedPsm
from robots.dvrk.parameters import SetupPositions, settable
from robots.dvrk.setup_joints import SIMULATED, CartArm, DrivenArm, base_pose
from robots.training.fixtures import FixtureParams
from schemas.errors import did_you_mean
from schemas.keys import valid_name
from schemas.quantity import Duration
from schemas.scenario import Name
from schemas.vectors import Vector

__all__ = ["MujocoParams", "SceneParams"]


@with_config(ConfigDict(extra="forbid"))
class _SetupJoints(TypedDict, total=False):
    PSM1: Annotated[SetupPositions, settable("PSM1")]
    PSM2: Annotated[SetupPositions, settable("PSM2")]
    PSM3: Annotated[SetupPositions, settable("PSM3")]
    ECM: Annotated[SetupPositions, settable("ECM")]


def _in_words(looks: Any) -> Any:
    """Return looks in words: they were a switch, and older recordings state them so."""
    return ("plain" if looks else "none") if isinstance(looks, bool) else looks


def _validated_as(form: Any) -> GetPydanticSchema:
    """Validate a mapping by `form`, with a type for each key."""
    return GetPydanticSchema(lambda _source, handler: handler(form))


def _object_names(objects: Mapping[str, ObjectParams]) -> Mapping[str, ObjectParams]:
    for name in objects:
        if not valid_name(name) or name in MountedArms.__annotations__:
            raise ValueError(
                f"'{name}' is not a valid name of an object: a letter, then letters, digits and underscores,"
                " and not the name of an arm"
            )
    return objects


class SceneParams(Params):
    """A scene: arms of a da Vinci Research Kit, masters at its console, a table, fixtures and objects."""

    model: Literal["dvrk"] = "dvrk"
    arms: Annotated[dict[DrivenArm, AnyArm], _validated_as(MountedArms), Field(min_length=1)]
    mounting: Literal["free", "cart"] = Field(
        default="free",
        description=(
            "each arm at its own position and orientation, or on the setup joints of the cart, whose frame is"
            " then the world; masters stand at the console either way"
        ),
    )
    setup_joints: Annotated[dict[CartArm, SetupPositions], _validated_as(_SetupJoints)] = Field(
        default_factory=dict[CartArm, SetupPositions],
        description=(
            "positions of the braked setup joints; an arm that is not named has the simulated positions"
        ),
    )
    table: TableParams | None = None
    fixtures: dict[Name, FixtureParams] = Field(
        default_factory=dict[str, FixtureParams], description="boards, dishes and phantoms, which stand fast"
    )
    objects: Annotated[dict[str, ObjectParams], AfterValidator(_object_names)] = Field(
        default_factory=dict[str, ObjectParams]
    )
    seed: int | None = Field(
        default=None,
        ge=0,
        description="varies where objects start, by the `scatter` of each; null: where they are put",
    )
    grasp: Literal["friction", "weld", "proximity"] = Field(
        default="friction",
        description=(
            "what holds an object between two jaws: friction alone; a weld while both jaws touch it; or, as"
            " in the authors' scene, a weld to what a ray from 5 to 13 mm ahead of the jaw meets first while"
            " the jaw's command is not above 0"
        ),
    )
    looks: Annotated[Literal["none", "plain", "endoscope"], BeforeValidator(_in_words)] = Field(
        default="plain",
        description=(
            "none: the robot has collision shapes only; plain: it has its meshes too; endoscope: cameras draw"
            " with light, textures and surroundings as an endoscope sees them, where Filament runs"
            " (`trocar doctor`)"
        ),
    )

    def base_pose(self, arm: DrivenArm) -> Vector:
        """Return the pose of the arm's base frame in the world, shape (4, 4)."""
        if self.mounting == "cart" and arm != "MTML" and arm != "MTMR":
            return base_pose(arm, np.array(self.setup_joints.get(arm, SIMULATED[arm])))
        return self.arms[arm].pose

    @model_validator(mode="after")
    def _stands_in_one_place(self) -> Self:
        if self.mounting == "free" and self.setup_joints:
            raise ValueError("setup_joints belong to the cart: set 'mounting: cart', or leave them out")
        placed = [
            name
            for name, arm in self.arms.items()
            if arm.model_fields_set & {"position", "orientation"} and not isinstance(arm, MountedMtm)
        ]
        if self.mounting == "cart":
            require_classic_cart(self.arms)
        if self.mounting == "cart" and placed:
            raise ValueError(
                f"{', '.join(placed)}: position and orientation are for 'mounting: free'; on the cart,"
                " setup_joints place the arms"
            )
        return self

    @model_validator(mode="after")
    def _names_differ(self) -> Self:
        if twice := self.objects.keys() & self.fixtures.keys():
            raise ValueError(
                f"{', '.join(sorted(twice))}: the name of an object and of a fixture; give each its own"
            )
        return self

    @model_validator(mode="after")
    def _rolls_by_friction(self) -> Self:
        rolling = [name for name, arm in self.arms.items() if isinstance(arm.end_effector, RollingJaw)]
        if rolling and self.objects and self.grasp != "friction":
            raise ValueError(
                f"grasp: {self.grasp} would lock the object that the instrument of {', '.join(rolling)}"
                " rolls; use grasp: friction"
            )
        return self


class MujocoParams(SceneParams, ToolParams):
    """A scene and stepping."""

    open_to_pages: ClassVar[bool] = True

    timestep: Duration = Field(
        default=500_000, ge=1000, description="sub-step of the physics; divides the participant's period"
    )
    publish_period: Duration = Field(
        default=5_000_000,
        gt=0,
        description=(
            "how often measured_cp, setpoint_js, qpos and the objects' poses are published; a multiple of the"
            " period"
        ),
    )
    measured_effort: Literal["servo", "motor"] = Field(
        default="servo",
        description=(
            "what measured_js reports: the effort of the servos, or the whole effort of the motors, what"
            " holds the arm against gravity included, as a real arm's currents tell"
        ),
    )
    bonded_joints: dict[CartArm, tuple[str, ...]] = Field(
        default_factory=dict[CartArm, tuple[str, ...]],
        description=(
            "joints driven through a bond `<arm>/<joint>` instead of the servo here, whose friction, springs"
            " and rotor they are then without: those are the drive's"
        ),
        examples=[{"PSM1": ["insertion"]}],
    )
    rigid_wrench: bool | Literal["last"] = Field(
        default=True,
        description=(
            "measure `rigid_wrench`: true, the mean over the sub-steps of a step; last, that of the last one,"
            " at less cost; false, not at all. Where it is not true, and no bond renews its force within a"
            " step, all sub-steps are one call"
        ),
    )
    lean: bool = Field(
        default=False,
        description=(
            "less physics, for learning: the leading joint carries the inertia of its linkage, whose links"
            " stand still in the model, and the covers of arms touch nothing"
        ),
    )

    @model_validator(mode="after")
    def _bonds_own_joints(self) -> Self:
        for name, joints in self.bonded_joints.items():
            own = [joint.name for joint in self.arms[name].chain.joints] if name in self.arms else []
            for joint in joints:
                if joint not in own:
                    raise ValueError(
                        f"bonded_joints: there is no joint '{joint}' of {name}.{did_you_mean(joint, own)}"
                    )
            if joints and name in self.arms and len(self.arms[name].variants) > 1:
                raise ValueError(f"bonded_joints: not beside `spares`, as {name} has them")
        return self

    @property
    def tools(self) -> tuple[Tool, ...]:
        """The instruments of all PSMs."""
        return tuple(
            tool
            for name, arm in self.arms.items()
            if isinstance(arm, MountedPsm)
            for tool in instrument_tools(name, arm, self.base_pose(name))
        )
