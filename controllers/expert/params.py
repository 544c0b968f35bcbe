"""Parameters of the expert: scene, hands and targets. SI units."""

from __future__ import annotations

from typing import ClassVar, Self

from pydantic import Field, model_validator

from controllers.motion.params import Arms, SetupJoints
from hub.participant import Params
from robots.dvrk.crtk import Mounting
from robots.dvrk.parameters import ArmName
from robots.training.fixtures import BoardParams, DishParams, FixtureParams
from schemas.errors import did_you_mean
from schemas.scenario import Name

__all__ = ["ExpertParams"]


class _Object(Params):
    """Kind of an object of the scene; other parameters belong to the engine."""

    model_config = Params.model_config | {"extra": "ignore"}

    kind: str


class ExpertParams(Params):
    """The scene, the working hands, and the targets of objects."""

    open_to_pages: ClassVar[bool] = True

    arms: Arms
    mounting: Mounting = "free"
    setup_joints: SetupJoints = SetupJoints()
    fixtures: dict[Name, FixtureParams] = Field(description="boards and dishes, as in the scene")
    objects: dict[Name, _Object] = Field(description="as in the scene; pieces and triangles are carried")
    hands: tuple[ArmName, ...] = Field(
        default=("PSM1", "PSM2"),
        min_length=1,
        max_length=2,
        description="which arms work: one alone, or two, the surgeon's right one first",
    )
    hand_over: bool = Field(
        default=False,
        description="two hands: whether the left one takes each ring up and gives it to the right one",
    )
    goals: dict[Name, Name] = Field(
        default_factory=dict[str, str], description="of each piece: the dish that it is carried to"
    )
    legs: int | None = Field(
        default=1,
        ge=1,
        description=(
            "of a board: how often all rings are carried, 1: over, 2: over and back, ...; null: until the"
            " session ends"
        ),
    )
    end: bool = Field(
        default=True, description="whether the session ends when the task is done, or nothing more can be"
    )

    @model_validator(mode="after")
    def _is_a_task(self) -> Self:
        if missing := [arm for arm in self.hands if arm not in self.arms.present_arms]:
            raise ValueError(f"hands: {', '.join(missing)} is no arm of the scene")
        if self.hand_over and len(self.hands) < 2:
            raise ValueError("hand_over needs two hands, such as [PSM1, PSM2]")
        dishes = [name for name, fixture in self.fixtures.items() if isinstance(fixture, DishParams)]
        for name, dish in self.goals.items():
            if name not in self.objects:
                raise ValueError(f"goals: no object '{name}'.{did_you_mean(name, self.objects)}")
            if dish not in dishes:
                raise ValueError(f"goals: no dish '{dish}'.{did_you_mean(dish, dishes)}")
        if not self.goals and self.board is None:
            raise ValueError("nothing to do: give `goals` of pieces, or a fixture of kind board")
        if self.goals and self.legs != 1:
            raise ValueError("legs: pieces are carried one way; only rings of a board go back")
        return self

    @property
    def board(self) -> BoardParams | None:
        """Board of the scene; None: no board."""
        return next((each for each in self.fixtures.values() if isinstance(each, BoardParams)), None)

    @property
    def rings(self) -> tuple[str, ...]:
        """Names of the triangular rings of the scene."""
        return tuple(name for name, each in self.objects.items() if each.kind == "triangle")
