"""The arms of cart and console in a scenario: base pose, tool and start of each arm.

SI units, radians.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from math import radians
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ValidationInfo,
    field_validator,
    model_validator,
    with_config,
)
from typing_extensions import TypedDict  # pydantic needs this one before Python 3.12

from robots import rotation
from robots.dvrk import arm_bodies, drives, ecm, mtm, psm, si
from robots.dvrk.drive import Disc, Drive
from robots.dvrk.end_effectors.contact_sphere import ContactSphere
from robots.dvrk.end_effectors.electrode import Electrode
from robots.dvrk.end_effectors.end_effector import EndEffector, Mount
from robots.dvrk.end_effectors.jaw import Jaw
from robots.dvrk.end_effectors.master_gripper import MasterGripper
from robots.dvrk.end_effectors.own_jaw import JawFile, with_own_jaw
from robots.dvrk.end_effectors.probe import PROBE_RADIUS, Probe
from robots.dvrk.end_effectors.scissors import Scissors
from robots.dvrk.end_effectors.suction_tube import SuctionTube
from robots.dvrk.hand_on_master import HandOnMaster
from robots.dvrk.inertia import Inertia
from robots.dvrk.instruments import Instrument, instrument
from robots.dvrk.link import Link
from robots.dvrk.own_dynamics import JAW, OwnDynamics
from robots.dvrk.parameters import (
    FOLDED,
    EcmPositions,
    HandPositions,
    InstrumentName,
    MountedPositions,
    MtmPositions,
    UnitQuaternion,
    check_start,
    home,
    start_positions,
)
from robots.serial_chain import SerialChain
from robots.transform import inverse_transform, rigid_transform
from schemas.errors import MotionError
from schemas.files import find_file
from schemas.quantity import Angle, Length
from schemas.scenario import Name
from schemas.vectors import Vector

__all__ = [
    "DEFAULT_INSTRUMENT",
    "AnyArm",
    "MountedArm",
    "MountedArms",
    "MountedEcm",
    "MountedMtm",
    "MountedMtml",
    "MountedMtmr",
    "MountedPsm",
    "PsmTool",
    "require_classic_cart",
]

DEFAULT_INSTRUMENT = "palpation-probe"

_WRISTED = 3
"""Joints of an instrument with roll, wrist pitch and wrist yaw."""
_EXCHANGED = (Jaw, Scissors, Electrode, SuctionTube)
"""End effectors of instruments that may be exchanged: a jaw of the name `jaw`, or none."""

_Published = tuple[Mapping[str, Inertia], Mapping[str, Drive], tuple[Disc, ...]]
"""Bodies, drives and discs."""


class MountedArm(BaseModel):
    """An arm: base pose, unless setup joints carry the arm."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    position: tuple[Length, Length, Length] = Field(
        default=(0.0, 0.0, 0.0), description="of the remote centre of motion in the world"
    )
    orientation: UnitQuaternion = Field(
        default=(0.0, 0.0, 0.0, 1.0),
        description="of the arm's base frame in the world: quaternion x, y, z, w",
    )
    dynamics: Path | None = Field(
        default=None,
        description="file of `trocar identify`: masses, friction, springs of your own arm; null: published",
    )

    @property
    def pose(self) -> Vector:
        """Pose of the base frame in the world, shape (4, 4), unless setup joints carry the arm."""
        return rigid_transform(rotation.matrix(np.array(self.orientation)), self.position)

    @cached_property
    @abstractmethod
    def chain(self) -> SerialChain:
        """The arm's kinematics."""

    @property
    def end_effector(self) -> EndEffector:
        """End effector of the arm's tool; without joints for an endoscope."""
        return EndEffector()

    @property
    def end_effector_start(self) -> tuple[float, ...]:
        """Positions of the end effector's joints at time 0."""
        return ()

    @cached_property
    def end_effector_links(self) -> tuple[Link, ...]:
        """Moving links of the end effector, parents before children."""
        return self.end_effector.links(Mount.on(self.chain))

    @property
    def spheres(self) -> tuple[ContactSphere, ...]:
        """Contact spheres for tissue."""
        return ()

    @property
    def variants(self) -> tuple[Self, ...]:
        """The arm as mounted, then with each spare instrument."""
        return (self,)

    def by_owner(self, arm: str) -> Mapping[str, Self]:
        """Return the variants of `arm` by the prefix of names in a model: `PSM1`, `PSM1/<spare>`."""
        return {arm: self}

    @property
    def commanded_end_effector(self) -> EndEffector:
        """End effector with the commanded joints: the instrument's, else the first spare's that has some."""
        return next((one.end_effector for one in self.variants if one.end_effector.joints), self.end_effector)

    @property
    @abstractmethod
    def _published(self) -> _Published: ...

    @property
    def _driven(self) -> list[str]:
        """Joints allowed in a file of `dynamics`; the last, a jaw, may be missing."""
        return [joint.name for joint in self.chain.joints]

    @field_validator("dynamics")
    @classmethod
    def _find(cls, file: Path | None, info: ValidationInfo) -> Path | None:
        return None if file is None else find_file(file, info)

    @model_validator(mode="after")
    def _has_these_dynamics(self) -> Self:
        if (own := self._own) is None:
            return self
        joints, discs = self._driven, len(self._published[2])
        if list(own.joints) not in (joints, [name for name in joints if name != JAW]) or (
            len(own.discs) != discs
        ):
            raise ValueError(
                f"dynamics: '{self.dynamics}' was identified with {own.instrument}, of joints"
                f" {', '.join(own.joints)} and {len(own.discs)} discs; this arm has"
                f" {', '.join(joints)} and {discs}: identify it with what it holds here"
            )
        return self

    @cached_property
    def _own(self) -> OwnDynamics | None:
        try:
            return None if self.dynamics is None else OwnDynamics.load(self.dynamics)
        except MotionError as error:
            raise ValueError(f"dynamics: {error}") from error

    @cached_property
    def bodies(self) -> Mapping[str, Inertia]:
        """Inertia of the bodies by link, tool included."""
        published = self._published[0]
        return published if self._own is None else self._own.bodies_of(published)

    @cached_property
    def drives(self) -> Mapping[str, Drive]:
        """Drives by joint, and by motor of the end effector."""
        published = self._published[1]
        return published if self._own is None else self._own.drives_of(published)

    @cached_property
    def discs(self) -> tuple[Disc, ...]:
        """The discs of an instrument."""
        published = self._published[2]
        return published if self._own is None else self._own.discs_of(published)


class PsmTool(BaseModel):
    """Instrument of a patient-side manipulator, and start of both."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    generation: si.Generation = Field(
        default="classic",
        description=(
            "of the da Vinci: si has the Si's ranges, efforts and gains, and instruments of the S and Si"
            " (numbers from 420001), with the Classic's masses and looks"
        ),
    )
    instrument: InstrumentName = Field(
        default=DEFAULT_INSTRUMENT, description="what the arm holds: name or number, such as 400006"
    )
    tip: Path | None = Field(
        default=None,
        description=(
            "file of `trocar instruments import`: fingers of your own in place of the instrument's jaw"
        ),
    )
    start: MountedPositions = Field(
        default_factory=home,
        description=f"joint positions at time 0: {', '.join(psm.JOINT_NAMES)}, or as many as there are",
    )
    jaw: Angle = Field(default=0.0, description="opening of the jaw at time 0")

    @property
    def _stated_positions(self) -> Mapping[str, Sequence[float]]:
        """Stated positions at time 0, by the name of the end effector."""
        return {"jaw": (self.jaw,)}

    @property
    def end_effector(self) -> EndEffector:
        """The instrument's end effector."""
        return self.tool.end_effector

    @property
    def end_effector_start(self) -> tuple[float, ...]:
        """Positions of the end effector's joints at time 0."""
        return start_positions(self.end_effector, self._stated_positions)

    @property
    def spheres(self) -> tuple[ContactSphere, ...]:
        """Contact spheres of the instrument, for tissue."""
        return self.tool.spheres

    @cached_property
    def tool(self) -> Instrument:
        """The instrument's numbers."""
        shaft = instrument(self.instrument)
        if self.generation == "si":
            if not si.fits(shaft):
                raise ValueError(
                    f"generation: {shaft.name} does not fit a PSM of the Si, which takes instruments of the S"
                    " and Si, with numbers from 420001, such as LARGE_NEEDLE_DRIVER_420006"
                )
            shaft = si.fitted(shaft)
        try:
            return shaft if self.tip is None else with_own_jaw(shaft, JawFile.load(self.tip))
        except MotionError as error:
            raise ValueError(f"tip: {error}") from error

    @cached_property
    def chain(self) -> SerialChain:
        """The arm's kinematics, from `<arm>_base` to the tip."""
        return psm.chain(self.tool) if self.generation == "classic" else si.fitted_chain(self.tool)

    @field_validator("tip")
    @classmethod
    def _find_tip(cls, file: Path | None, info: ValidationInfo) -> Path | None:
        return None if file is None else find_file(file, info)

    @model_validator(mode="after")
    def _starts_in_range(self) -> Self:
        check_start(self.chain, self.start, self.end_effector, self._stated_positions)
        return self


class MountedPsm(PsmTool, MountedArm):
    """A patient-side manipulator: base pose, instrument and start."""

    probe_radius: Length = Field(
        default=PROBE_RADIUS, gt=0.0, description="radius of the sphere of a palpation probe"
    )
    hand: HandPositions = Field(
        default=FOLDED,
        description="closings, then spreads, of a hand's fingers at time 0; default: folded",
    )
    touches: tuple[Name, ...] = Field(
        default=(),
        description=(
            "organs that the instrument touches: the tissue gets a probe of the arm's name, and the session a"
            " bond between both; state either for numbers of your own"
        ),
    )

    spares: tuple[InstrumentName, ...] = Field(
        default=(),
        description=(
            "instruments that the arm may be given in exchange while the session runs: names or numbers;"
            " with a jaw or a rigid tip, and with the wrist of an 8 mm instrument"
        ),
    )

    @property
    def variants(self) -> tuple[Self, ...]:
        """The arm as mounted, then with each spare instrument, its joints at the start."""
        return self, *self._with_spares

    @cached_property
    def _with_spares(self) -> tuple[Self, ...]:
        fields = {name: getattr(self, name) for name in type(self).model_fields} | {"spares": ()}
        return tuple(
            self.model_construct(self.model_fields_set, **(fields | {"instrument": spare, "jaw": 0.0}))
            for spare in self.spares
        )

    def by_owner(self, arm: str) -> Mapping[str, Self]:
        """Return the variants of `arm` by the prefix of names in a model: `PSM1`, `PSM1/<spare>`."""
        mounted, *others = self.variants
        return {arm: mounted} | {f"{arm}/{other.instrument.replace('-', '_')}": other for other in others}

    @model_validator(mode="after")
    def _exchanges_what_fits(self) -> Self:
        if not self.spares:
            return self
        if self.tip is not None or self.dynamics is not None:
            raise ValueError("spares: not beside `tip` or `dynamics`, which are those of one instrument")
        tools = [instrument(name) for name in (self.instrument, *self.spares)]
        for tool in tools:
            if len(tool.joints) != _WRISTED or type(tool.end_effector) not in _EXCHANGED:
                raise ValueError(
                    f"spares: {tool.name} cannot be exchanged while a session runs; allowed are instruments"
                    " with roll, wrist and a jaw or a rigid tip"
                )
            if tools.count(tool) > 1:
                raise ValueError(f"spares: {tool.name} is named twice; name each instrument once")
        for variant in self.variants[1:]:
            try:
                variant.chain.check(np.array(self.start, np.float64))
            except MotionError as error:
                raise ValueError(f"spares: with {variant.instrument} {error}") from error
        return self

    @cached_property
    def tool(self) -> Instrument:
        """The instrument's numbers; a palpation probe with the scene's radius."""
        tool = super().tool
        is_probe = isinstance(tool.end_effector, Probe)
        return replace(tool, end_effector=Probe(self.probe_radius)) if is_probe else tool

    @property
    def reach(self) -> float:
        """Largest distance of the instrument's end from the remote centre of motion, m."""
        out = np.array([joint.upper if joint.kind == "prismatic" else 0.0 for joint in self.chain.joints])
        return float(np.linalg.norm(self.chain.forward(out)[:3, 3])) + self._extent

    @property
    def sphere_centres(self) -> Vector:
        """Centres of the contact spheres in the tip's frame, every joint at 0, m, shape (n, 3).

        A palpation probe is one sphere at the tip.
        """
        if isinstance(self.end_effector, Probe):
            return np.zeros((1, 3))
        mount = Mount.on(self.chain)
        poses = {link.name: link.pose for link in self.end_effector_links} | {mount.link: mount.pose}
        from_base = inverse_transform(mount.tip)
        centres = [from_base @ poses[one.link] @ (*one.position, 1.0) for one in self.spheres]
        return np.array(centres).reshape(-1, 4)[:, :3]

    @property
    def _extent(self) -> float:
        """Distance of the end of the farthest sphere from the tip, m."""
        radius = self.probe_radius if isinstance(self.end_effector, Probe) else 0.0
        radius = max([radius, *(sphere.radius for sphere in self.spheres)])
        return radius + max(np.linalg.norm(self.sphere_centres, axis=1).tolist(), default=0.0)

    @property
    def _driven(self) -> list[str]:
        jaw = [] if self.tool.jaw is None else [JAW]
        return [*super()._driven, *jaw]

    @property
    def _published(self) -> _Published:
        driven = drives.psm(self.tool, self.generation)
        return arm_bodies.psm(self.tool), driven, drives.discs(self.tool)

    @property
    def _stated_positions(self) -> Mapping[str, Sequence[float]]:
        return {**super()._stated_positions, "hand": self.hand}


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
    def _published(self) -> _Published:
        return arm_bodies.ecm(), drives.ECM if self.generation == "classic" else drives.ECM_SI, ()

    @model_validator(mode="after")
    def _starts_in_range(self) -> Self:
        check_start(self.chain, self.start)
        return self


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
    def _published(self) -> _Published:
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


AnyArm = MountedPsm | MountedEcm | MountedMtm
"""Any simulated arm."""


def require_classic_cart(arms: Mapping[Any, object]) -> None:
    """Raise ValueError, as validators do, for an arm of the Si on the cart."""
    other = [name for name, one in arms.items() if getattr(one, "generation", "classic") == "si"]
    if other:
        raise ValueError(
            f"{', '.join(other)}: the cart is that of the Classic; set 'mounting: free' and place an arm of"
            " the Si by position and orientation"
        )


@with_config(ConfigDict(extra="forbid"))
class MountedArms(TypedDict, total=False):
    """The arms of cart and console by name, for validation."""

    PSM1: MountedPsm
    PSM2: MountedPsm
    PSM3: MountedPsm
    ECM: MountedEcm
    MTML: MountedMtml
    MTMR: MountedMtmr
