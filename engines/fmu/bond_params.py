"""Bonds of an FMU as a scenario states them: the variables of force, position and velocity."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, WithJsonSchema, model_validator

__all__ = ["FmuBond"]


def _listed(names: object) -> object:
    return (names,) if isinstance(names, str) else names


_LIST = {"type": "array", "items": {"type": "string"}, "minItems": 1, "maxItems": 3}
VariableNames = Annotated[
    tuple[str, ...],
    Field(max_length=3),
    BeforeValidator(_listed),
    WithJsonSchema({"anyOf": [{"type": "string"}, _LIST]}),
]
"""One name, or a list with a name for each degree of freedom; empty: by a terminal."""


class FmuBond(BaseModel):
    """A bond: its side and variables, and the numbers for the stable-step rule."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    terminal: str = Field(
        default="",
        description=(
            "terminal of an FMI 3.0 FMU that has a force (inflow or outflow), a position and a velocity, in"
            " place of `side`, `force`, `position` and `velocity`"
        ),
    )
    side: Literal["force", "motion"] | None = Field(
        default=None,
        description="force: the FMU takes position and velocity and gives a force; motion: the reverse",
    )
    force: VariableNames = Field(
        default=(),
        description=(
            "FMU variable of the force on the motion side, positive along the position, as the adaptors of"
            " the Modelica Standard Library have it; or a list, one for each degree of freedom"
        ),
    )
    position: VariableNames = Field(default=(), description="FMU variable of the position, or a list")
    velocity: VariableNames = Field(default=(), description="FMU variable of the velocity, or a list")
    coordinate: Literal["length", "angle"] | None = Field(
        default=None,
        description="for an FMU without units: m, m/s and N, or rad, rad/s and N m; default: by its units",
    )
    frame: str = Field(default="", description="frame of the positions, if any")
    stiffness: float | None = Field(
        default=None,
        ge=0,
        allow_inf_nan=False,
        description=(
            "force side: largest rise of the force over the position, N/m or N m/rad; default: the FMU's"
            " directional derivative at the start, else measured there"
        ),
    )
    damping: float | None = Field(
        default=None,
        ge=0,
        allow_inf_nan=False,
        description="force side: the same over the velocity, N s/m or N m s/rad",
    )
    effective_mass: float | None = Field(
        default=None,
        gt=0,
        allow_inf_nan=False,
        description="motion side: smallest mass or inertia, kg or kg m^2; default: measured at the start",
    )

    @model_validator(mode="after")
    def _is_stated_once(self) -> Self:
        stated = [name for name in ("side", "force", "position", "velocity") if getattr(self, name)]
        if self.terminal and stated:
            raise ValueError(f"a terminal says what is {', '.join(stated)}: state one or the other")
        if self.terminal:
            return self
        if missing := [n for n in ("side", "force", "position", "velocity") if n not in stated]:
            raise ValueError(f"{', '.join(missing)} missing: state these, or a terminal of the FMU")
        self.check_side(self.side)
        return self

    def check_side(self, side: str | None) -> None:
        """Raise ValueError for a number of the side opposite to `side`."""
        rules = ("stiffness", "damping") if side == "motion" else ("effective_mass",)
        if wrong := [name for name in rules if getattr(self, name) is not None]:
            raise ValueError(f"a {side} side has no {' and no '.join(wrong)}")
