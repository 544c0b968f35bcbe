"""Common parameters of all tasks.

Arms, mounting and objects come from the scenario's `scene`. Poses are in the world.
"""

from __future__ import annotations

from math import inf
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, GetPydanticSchema

from hub.participant import Params
from robots.dvrk import endoscope
from robots.dvrk.endoscope import StereoCamera
from robots.dvrk.mounted.mounted_arms import AnyArm, MountedArms
from robots.dvrk.mounted.mounted_ecm import MountedEcm
from robots.dvrk.mounted.mounted_psm import MountedPsm
from robots.dvrk.parameters import SetupPositions
from robots.dvrk.setup_joints import CartArm, DrivenArm
from robots.training.fixtures import FixtureParams
from schemas.quantity import Angle, Duration, Force, Length, Speed

__all__ = ["TaskParams"]


_Point = tuple[Length, Length, Length]


class TaskParams(Params):
    """Watched objects and arms of the task, and thresholds of events."""

    open_to_pages: ClassVar[bool] = True

    arms: Annotated[dict[DrivenArm, AnyArm], GetPydanticSchema(lambda _, handler: handler(MountedArms))] = (
        Field(min_length=1, description="as in the scene: where each stands, and which endoscope looks on")
    )
    mounting: Literal["free", "cart"] = Field(default="free", description="as in the scene")
    setup_joints: dict[CartArm, SetupPositions] = Field(
        default_factory=dict[CartArm, SetupPositions], description="as in the scene"
    )
    objects: dict[str, Any] = Field(
        default_factory=dict[str, Any], description="as in the scene: the task watches those of its names"
    )
    fixtures: dict[str, FixtureParams] = Field(
        default_factory=dict[str, FixtureParams], description="as in the scene: boards and dishes"
    )
    rules: tuple[str, ...] = Field(
        default=(), description="by which the card scores; default: all that apply"
    )
    benchmarks: dict[str, float] = Field(
        default_factory=dict[str, float],
        description=(
            "for the rules `mscore`: by metric the largest value that passes, in the metric's unit; of a"
            " share, an economy or a spectral arc length the least"
        ),
    )
    workspace: tuple[_Point, _Point] | None = Field(
        default=None,
        description="two opposite corners; objects outside are out of the workspace. Default: the task's own",
    )
    lift: Length = Field(default=5e-3, gt=0, description="an object that is held so high has been lifted")
    drop: Length = Field(default=5e-3, gt=0, description="an object that falls so far has been dropped")
    idle_speed: Speed = Field(default=1e-3, gt=0, description="a tip that is slower is idle")
    force_limit: Force = Field(default=5.0, gt=0, description="more on an instrument is excessive")
    width: int = Field(default=endoscope.WIDTH, ge=1, description="of the endoscope's pictures, in pixels")
    height: int = Field(default=endoscope.HEIGHT, ge=1, description="of the endoscope's pictures, in pixels")
    field_of_view: Angle = Field(
        default=endoscope.FIELD_OF_VIEW, gt=0.0, lt=3.0, description="of the endoscope, horizontal"
    )
    baseline: Length = Field(default=endoscope.BASELINE, ge=0.0, description="between its two cameras")
    near: Length = Field(default=endoscope.NEAR, gt=0.0, description="anything nearer is invisible")
    far: Length = Field(default=endoscope.FAR, gt=0.0, lt=inf, description="anything farther is invisible")
    card_period: Duration = Field(
        default=100_000_000, gt=0, description="how often the card is published; a multiple of the period"
    )

    @property
    def watched_arms(self) -> tuple[CartArm, ...]:
        """The arms of the cart, in the scenario's order: no task watches masters."""
        return tuple(name for name in self.arms if name != "MTML" and name != "MTMR")

    @property
    def psms(self) -> tuple[CartArm, ...]:
        """The arms with instruments, in the scenario's order."""
        return tuple(name for name in self.watched_arms if isinstance(self.arms[name], MountedPsm))

    @property
    def ecm(self) -> CartArm | None:
        """The arm with the endoscope; None: none."""
        return next((name for name in self.watched_arms if isinstance(self.arms[name], MountedEcm)), None)

    @property
    def camera(self) -> StereoCamera:
        """The two cameras of the endoscope."""
        return StereoCamera(self.width, self.height, self.field_of_view, self.baseline)
