"""Parameters of the suturing pad."""

from __future__ import annotations

from typing import Any, ClassVar, Self

from pydantic import Field, model_validator

from engines.suture_pad.tissue import TissueParams
from hub.participant import Params
from robots.training.fixtures import FixtureParams, PhantomParams
from robots.training.needle_object import NeedleObject, needles_of
from schemas.quantity import Duration
from schemas.scenario import Name

__all__ = ["SuturePadParams"]


class SuturePadParams(Params):
    """Phantom and needle of the scene, tissue, and numerics."""

    open_to_pages: ClassVar[bool] = True

    fixtures: dict[Name, FixtureParams] = Field(description="as in the scene: one of them is the phantom")
    objects: dict[Name, dict[str, Any]] = Field(description="as in the scene: one of them is the needle")
    tissue: TissueParams = TissueParams()
    timestep: Duration = Field(
        default=1_000_000, ge=10_000, description="sub-step; the period is a multiple of it"
    )
    node_period: Duration = Field(
        default=40_000_000, gt=0, description="how often the skin is output; a multiple of the period"
    )

    @model_validator(mode="after")
    def _one_of_each(self) -> Self:
        phantoms = [name for name, one in self.fixtures.items() if isinstance(one, PhantomParams)]
        for what, names, example in (
            ("phantoms", phantoms, "fixtures: {phantom: {kind: phantom, phantom: branch-top, ...}}"),
            ("needles", list(needles_of(self.objects)), "objects: {needle: {kind: needle, ...}}"),
        ):
            if len(names) != 1:
                raise ValueError(
                    f"the scene has {len(names)} {what}{': ' if names else ''}{', '.join(names)}; one is"
                    f" needed: `{example}`"
                )
        return self

    @property
    def phantom(self) -> PhantomParams:
        """The phantom with its place."""
        return next(one for one in self.fixtures.values() if isinstance(one, PhantomParams))

    @property
    def needle(self) -> tuple[str, NeedleObject]:
        """Name and wire of the needle."""
        return next(iter(needles_of(self.objects).items()))
