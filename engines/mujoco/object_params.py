"""Parameters of the table and the objects in a scene. Lengths in m, poses in the world."""

from __future__ import annotations

from math import pi, radians
from typing import Annotated, Any, Literal, Self, cast

from pydantic import Field, model_validator

from hub.participant import Params
from robots.dvrk.inertia import STEEL_DENSITY
from robots.dvrk.parameters import UnitQuaternion
from robots.training.boards import BOARDS, Ring
from robots.training.fixtures import BoardName
from robots.training.needles import DEFAULT, NEEDLES, NeedleName
from robots.training.threads import ThreadParams
from schemas.quantity import Angle, Damping, Density, Length

__all__ = [
    "BlockParams",
    "NeedleParams",
    "ObjectParams",
    "PieceParams",
    "RingParams",
    "TableParams",
    "TriangleParams",
]

POLYAMIDE_DENSITY = 1130.0
"""Polyamide 6, kg/m^3 (1.12 to 1.14 g/cm^3 by the makers' data sheets)."""


_Side = Annotated[Length, Field(gt=0.0)]
_Reach = Annotated[Length, Field(ge=0.0)]
_Turn = Annotated[Angle, Field(ge=0.0, le=pi)]


class _Object(Params):
    position: tuple[Length, Length, Length] = Field(
        description="of the object's frame in the world at time 0"
    )
    orientation: UnitQuaternion = Field(
        default=(0.0, 0.0, 0.0, 1.0),
        description="of the object's frame in the world at time 0: quaternion x, y, z, w",
    )
    scatter: tuple[_Reach, _Reach, _Turn] = Field(
        default=(0.0, 0.0, 0.0),
        description=(
            "how far the scene's `seed` may move the start along x and y of the world, and turn it about z,"
            " to either side"
        ),
    )


class _Wire(_Object):
    """A round wire along an arc of a circle."""

    radius: Length
    wire_radius: Length

    @model_validator(mode="after")
    def _is_thinner_than_its_circle(self) -> Self:
        if self.wire_radius >= self.radius:
            raise ValueError(
                f"wire_radius ({self.wire_radius:g} m) must be less than radius ({self.radius:g} m)"
            )
        return self


class RingParams(_Wire):
    """A torus; frame in the middle, z along the axis."""

    kind: Literal["ring"]
    radius: Length = Field(default=8e-3, gt=0.0, description="of the centre line")
    wire_radius: Length = Field(default=1e-3, gt=0.0, description="of the cross-section")
    density: Density = Field(default=POLYAMIDE_DENSITY, gt=0.0)

    @property
    def arc(self) -> float:
        """The whole turn, rad."""
        return 2.0 * pi


class NeedleParams(_Wire):
    """A round wire bent to an arc.

    Frame in the arc's centre, z normal to the plane of the arc, x to the middle of the wire. The default is
    the needle of unina-icaros/dvrk-vrep (dVRK-suturing.ttt): an arc of 180.9 degrees, centre line 11.44 mm,
    wire 0.8 mm.
    """

    kind: Literal["needle"]
    needle: NeedleName = Field(
        default=DEFAULT, description="gives radius, wire_radius and arc where they are not given"
    )
    radius: Length = Field(default=11.44e-3, gt=0.0, description="of the centre line")
    wire_radius: Length = Field(default=0.4e-3, gt=0.0, description="of the cross-section")
    arc: Angle = Field(default=radians(180.9), gt=0.0, lt=2.0 * pi, description="from end to end")
    density: Density = Field(default=STEEL_DENSITY, gt=0.0)
    drag: Damping = Field(
        default=8.0,
        ge=0.0,
        description=(
            "viscous resistance of the tissue that a bond at the wire stands for, while it pushes: 0.05 N at"
            " 6 mm/s. A needle that no jaw holds is at rest in tissue as stiff as this over four steps"
        ),
    )

    thread: ThreadParams | None = Field(default=None, description="swaged into its base; null: none")

    @model_validator(mode="before")
    @classmethod
    def _named_wire(cls, given: Any) -> Any:
        """Fill in the measures of the named needle; a value of another type is refused later."""
        if not isinstance(given, dict):
            return given
        stated = cast("dict[str, Any]", given)
        if stated.get("needle") not in NEEDLES:
            return stated
        wire = NEEDLES[stated["needle"]]
        return {"radius": wire.radius, "wire_radius": wire.wire_radius, "arc": wire.arc, **stated}

    marked: bool = Field(
        default=False,
        description=(
            "green, with a blue ball of 0.9 mm at the tip, as in the authors' scene of needle tracking; it is"
            " seen and not felt"
        ),
    )


class BlockParams(_Object):
    """A box; frame in the middle.

    Default size: the small objects in unina-icaros/dvrk-vrep, dVRK-training_pick&place.ttt.
    """

    kind: Literal["block"]
    size: tuple[_Side, _Side, _Side] = Field(default=(9e-3, 14e-3, 20.5e-3), description="along x, y and z")
    density: Density = Field(default=POLYAMIDE_DENSITY, gt=0.0)


class PieceParams(_Object):
    """A small piece of the authors' pick-and-place scene (`robots.training.dishes`), a light box."""

    kind: Literal["piece"]


class TriangleParams(_Object):
    """A triangular ring of a peg board; frame in the middle, z along the axis, y to a corner."""

    kind: Literal["triangle"]
    ring: BoardName = Field(description="the board that it belongs to, which states its measures")

    @property
    def measures(self) -> Ring:
        """Measures, mass and friction."""
        return BOARDS[self.ring].ring


ObjectParams = Annotated[
    RingParams | NeedleParams | BlockParams | PieceParams | TriangleParams, Field(discriminator="kind")
]
"""A movable object."""


class TableParams(Params):
    """A fixed slab with a level top. Default size: as in all scenes of unina-icaros/dvrk-vrep."""

    position: tuple[Length, Length, Length] = Field(description="of the middle of its top in the world")
    size: tuple[_Side, _Side, _Side] = Field(default=(0.4972, 0.6952, 0.02), description="along x, y and z")
    soft: bool = Field(
        default=False,
        description=(
            "a pad of foam: instruments reach into it without resistance, so that a jaw can take a thin thing"
            " that lies on it well inside its fingers"
        ),
    )
    friction: float | None = Field(
        default=None,
        gt=0.0,
        description=(
            "coefficient with which things slide on it; without twisting friction; by default their own,"
            " with which a closing jaw sometimes throws a needle (docs/decisions/0090)"
        ),
    )
