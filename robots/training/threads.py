"""The thread behind a suturing needle as a scene states it: an elastic rod of equal segments. SI units."""

from __future__ import annotations

from math import pi

from pydantic import BaseModel, ConfigDict, Field

from schemas.quantity import Damping, Density, Length, Mass, Pressure

__all__ = ["ThreadParams"]


class ThreadParams(BaseModel):
    """A thread that is swaged into the base of a needle, and straight behind it at time 0."""

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
        default=20, ge=4, le=60, description="equal in length; the cost grows with their number"
    )
    density: Density = Field(default=1400.0, gt=0.0, description="about that of polyglactin; assumed")
    node_mass: Mass = Field(
        default=5e-5,
        gt=0.0,
        description=(
            "inertia of each node; its weight is by density. Assumed, and far more than that: a tension up to"
            " node_mass segment / timestep^2, here 1 N, does not make it tremble"
        ),
    )
    young: Pressure = Field(
        default=1e8,
        gt=0.0,
        description=(
            "modulus in bending. Assumed: a tenth of a solid fibre's, as a braid's filaments slide; along"
            " its length it does not stretch"
        ),
    )
    drag: Damping = Field(
        default=2.0,
        ge=0.0,
        description=(
            "viscous resistance of tissue at each node that the pad pushes on. Assumed: as little as keeps a"
            " node of a third of a milligram at rest there"
        ),
    )

    @property
    def segment(self) -> float:
        """Length of a segment, m."""
        return self.length / self.segments

    @property
    def true_mass(self) -> float:
        """Mass of a segment, kg, whose weight is that of the node at its far end."""
        return self.density * pi * self.radius**2 * self.segment
