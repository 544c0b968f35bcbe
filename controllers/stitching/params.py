"""Parameters of the stitching expert: the scene, and the stitches to make. SI units."""

from __future__ import annotations

from math import radians
from typing import Any, ClassVar, Self

from pydantic import Field, model_validator

from controllers.motion.params import Arms, SetupJoints
from hub.participant import Params
from robots.dvrk.crtk import Mounting
from robots.dvrk.parameters import ArmName
from robots.training.fixtures import FixtureParams, PhantomParams
from robots.training.needle_object import NeedleObject, needles_of
from schemas.quantity import Angle, Length
from schemas.scenario import Name

__all__ = ["StitchParams", "StitchingParams"]


class StitchParams(Params):
    """The scene, the two hands, and how a stitch is made."""

    arms: Arms
    mounting: Mounting = "free"
    setup_joints: SetupJoints = SetupJoints()
    fixtures: dict[Name, FixtureParams] = Field(description="as in the scene: one of them is the phantom")
    objects: dict[Name, dict[str, Any]] = Field(description="as in the scene: one of them is the needle")
    driver: ArmName = Field(default="PSM1", description="the arm that drives the needle in: the right hand")
    puller: ArmName = Field(default="PSM2", description="the arm that pulls it out: the left hand")
    held: Angle | None = Field(
        default=None,
        gt=0.0,
        description="from its tip to where the driver holds it; default: 155 degrees, or its arc less 20",
    )
    taken: Angle = Field(
        default=radians(13.0), gt=0.0, description="how far behind its tip the puller takes the needle"
    )
    emerge: Angle = Field(
        default=radians(38.0), gt=0.0, description="how much of the arc comes out before it is taken"
    )
    drive_speed: Angle = Field(
        default=radians(25.0), gt=0.0, description="how fast the needle is turned through tissue, per second"
    )
    lift: Length = Field(default=0.025, gt=0.0, description="how high over the skin the needle is carried")

    @model_validator(mode="after")
    def _is_a_scene(self) -> Self:
        if missing := [arm for arm in (self.driver, self.puller) if arm not in self.arms.present_arms]:
            raise ValueError(f"{', '.join(missing)} is no arm of the scene")
        if self.driver == self.puller:
            raise ValueError(f"driver and puller are both {self.driver}; a stitch needs two hands")
        phantoms = [one for one in self.fixtures.values() if isinstance(one, PhantomParams)]
        if len(phantoms) != 1:
            raise ValueError(f"the scene has {len(phantoms)} phantoms, one is needed")
        if len(needles_of(self.objects)) != 1:
            raise ValueError(f"the scene has {len(needles_of(self.objects))} needles, one is needed")
        return self

    @property
    def grip(self) -> float:
        """How far behind the tip the driver holds the needle, rad."""
        most = self.needle[1].shape.arc - radians(20.0)
        return min(radians(155.0), most) if self.held is None else self.held

    @property
    def phantom(self) -> PhantomParams:
        """The phantom at its place."""
        return next(one for one in self.fixtures.values() if isinstance(one, PhantomParams))

    @property
    def needle(self) -> tuple[str, NeedleObject]:
        """Name and wire of the needle."""
        return next(iter(needles_of(self.objects).items()))


class StitchingParams(StitchParams):
    """The stitches to make, in turn."""

    open_to_pages: ClassVar[bool] = True

    stitches: int = Field(
        default=4, ge=1, le=4, description="how many, from the phantom's first pair of holes"
    )
    first: int = Field(default=1, ge=1, le=4, description="number of the pair of holes to begin with")
    end: bool = Field(default=True, description="whether the session ends when the last stitch is made")

    @model_validator(mode="after")
    def _has_the_holes(self) -> Self:
        pairs = len(self.phantom.measures.entries)
        if self.first + self.stitches - 1 > pairs:
            raise ValueError(
                f"stitches {self.first} to {self.first + self.stitches - 1}: the phantom has {pairs} pairs"
            )
        return self
