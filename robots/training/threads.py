"""The thread of a suturing needle in a scene: an elastic rod of equal segments. SI units."""

from __future__ import annotations

from math import pi

from pydantic import BaseModel, ConfigDict, Field

from schemas.quantity import Density, Length, Pressure, Speed

__all__ = ["THREAD", "ThreadParams"]

THREAD = "thread"
"""Name of the soft body for drawing the thread: `<name>/nodes`."""
_GRAVITY = 9.81
"""m/s^2."""


class ThreadParams(BaseModel):
    """A thread swaged into the base of a needle, straight behind the needle at time 0."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    length: Length = Field(
        default=0.1,
        gt=0.0,
        description="of the thread; the Surgical Robotics Challenge has 107 mm (ADF/Thread)",
    )
    radius: Length = Field(
        default=1.2e-4, gt=0.0, description="half the diameter of size 3-0, which is 0.20 to 0.25 mm (USP)"
    )
    segments: int = Field(
        default=40, ge=4, le=100, description="equal in length; the cost of its shape grows with their number"
    )
    density: Density = Field(default=1400.0, gt=0.0, description="about that of polyglactin; assumed")
    young: Pressure = Field(
        default=1e8,
        gt=0.0,
        description=(
            "modulus in bending. Assumed: a tenth of a solid fibre's, as a braid's filaments slide; along"
            " its length it does not stretch"
        ),
    )
    sinking: Speed = Field(
        default=0.1,
        gt=0.0,
        description="speed at which it falls, for its drag. Assumed, by eye; without effect on any force",
    )

    @property
    def segment(self) -> float:
        """Length of a segment, m."""
        return self.length / self.segments

    @property
    def relaxation(self) -> float:
        """Bending stiffness over drag, m^4/s: E I / c, with the drag c for the stated speed of sinking."""
        drag = self.density * pi * self.radius**2 * _GRAVITY / self.sinking
        return self.young * pi * self.radius**4 / 4.0 / drag
