"""Parameters of a probe: spheres, virtual coupling, and grasping fingers."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from engines.tissue.probes.clip import ClipParams
from engines.tissue.probes.energy import EnergyParams
from engines.tissue.probes.irrigation import IrrigationParams
from engines.tissue.probes.suction import SuctionParams
from schemas.quantity import Damping, Force, Length, Mass, Stiffness
from schemas.vectors import Vector

__all__ = ["Coupling", "GraspParams", "ProbeParams", "ScissorsParams"]

_STIFFNESS_RATIO = 20.0
"""Stiffness of the virtual coupling over the contact's: a quick press loses 1/21, 5 %, of its way to the
coupling; a lasting press loses nothing, see `Coupling.reset_time`.
"""

_SUB_GRID_RATIO = 12.0
"""Stiffness ratio with the mesh's missing compliance in series (`sub_grid`): the law counts the coupling's
own yield. Stiffer, and so heavier, proxies bounce off soft contacts; softer proxies follow a quick press
worse.
"""

_STEP_SHARE = 0.5
"""Sub-step times sqrt(k / m): keeps the explicit spring and damper of a proxy well inside stability (explicit
limit with critical damping: 2 (sqrt(2) - 1)).
"""

_RESET_SHARE = 4.0
"""Reset time times sqrt(k / m): slow beside the proxy's own oscillation."""

_PASSIVE_SHARE = 0.5
"""Fraction of the tissue's damping usable by the reset: contacts may be twice as stiff as estimated, and a
scheme of finite steps lags too.
"""

Radius = Annotated[Length, Field(ge=0.5e-3)]


_SOFTEST_SHARE = 0.05
"""Least stiffness to which people may soften a coupling while it runs, as a share of that at the start: with
the default ratio the coupling then yields as much as the tissue.
"""


@dataclass
class Coupling:
    """The spring and damper between each proxy and the instrument's sphere, and the proxy's mass."""

    stiffness: float
    """k, N/m; may change while the session runs."""
    mass: float
    """m, kg."""
    damping: float
    """b, N s/m."""
    reset_time: float | None
    """Reset time T of a proportional and integral spring, s: at rest, the proxy stands at the instrument's
    sphere for any force.

    None: a proportional spring, with a yield of force / k.
    """

    least_stiffness: float
    """Least k, N/m, to which the coupling may be softened: mass, damping and reset time stay passive."""

    @property
    def longest_step(self) -> float:
        """Longest sub-step (s) of the proxy: 0.5 sqrt(m / k)."""
        return _STEP_SHARE * sqrt(self.mass / self.stiffness)


class GraspParams(BaseModel):
    """Fingers grasping tissue. SI units after validation."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    fingers: int = Field(
        default=2,
        ge=2,
        description="how many; each has the same number of the probe's spheres, finger after finger",
    )
    hold: Force = Field(
        default=5.0,
        gt=0,
        description=(
            "pull at which the tissue tears loose; default: that for which the jaws of laparoscopic graspers"
            " are compared (Heijnsdijk et al. 2004)"
        ),
    )
    reach: Length | None = Field(
        default=None,
        ge=0,
        description=(
            "from a sphere to the nodes it takes; default: of an organ's mean edge 1 / sqrt(3), within which"
            " every point has a node"
        ),
    )
    width: Length | None = Field(
        default=None,
        gt=0,
        description=(
            "of a jaw's pad: a pull is that of tissue held by so wide a patch, on anchored organs of at most"
            " 1200 nodes; default: of the nodes that the mesh holds, 1.2 to 5.5 times as stiff"
        ),
    )


Edge = tuple[int, int]
"""Two spheres of a probe, counted from 0."""


class ScissorsParams(BaseModel):
    """Two edges about a hinge."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    left: Edge = Field(description="edge from the hinge to its end")
    right: Edge = Field(description="the other one")
    hinge: int = Field(
        description="a sphere on the hinge, on the side from where the left edge closes clockwise"
    )


class ProbeParams(BaseModel):
    """The spheres of an instrument and their virtual coupling. SI units after validation."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    spheres: int | None = Field(
        default=None,
        ge=1,
        le=100,
        description="contact spheres bonded as points; without it the probe is one sphere on a frame",
    )
    radius: Radius | tuple[Radius, ...] = Field(
        default=5e-3, description="one for all spheres, or one for each"
    )
    stiffness: Stiffness | None = Field(
        default=None,
        gt=0,
        description="k of the virtual coupling; default: 20 times that of the stiffest organ at the contact",
    )
    mass: Mass | None = Field(
        default=None,
        gt=0,
        description="m of each proxy; default: the least for which the sub-step is at most 0.5 sqrt(m / k)",
    )
    damping: Damping | None = Field(
        default=None, gt=0, description="b of the virtual coupling; default: critical, 2 sqrt(k m)"
    )
    grasp: GraspParams | None = Field(default=None, description="lets the spheres grasp tissue, as fingers")
    energy: EnergyParams | None = Field(
        default=None, description="makes the spheres electrodes that heat tissue; kind fem"
    )
    suction: SuctionParams | None = Field(
        default=None, description="lets the spheres take up blood, by the command `<probe>/suction`; kind fem"
    )
    irrigation: IrrigationParams | None = Field(
        default=None,
        description="lets saline out at the first sphere, by the command `<probe>/irrigation`; kind fem",
    )
    clip: ClipParams | None = Field(
        default=None, description="lets two jaws put clips on a tube, by the event `<probe>/clip`; kind fem"
    )
    blades: tuple[Edge, ...] = Field(
        default=(),
        max_length=8,
        description=(
            "sharp edges, each from one of the probe's spheres to another, counted from 0; these spheres pass"
            " through organs with `cutting`; kind fem alone"
        ),
    )
    scissors: ScissorsParams | None = Field(
        default=None,
        description=(
            "edges that cut as blades do while they close on each other, and press otherwise; kind bullet:"
            " they press; default: those of the instrument that `touches` an organ"
        ),
    )

    @model_validator(mode="after")
    def _a_radius_for_each(self) -> ProbeParams:
        if isinstance(self.radius, tuple) and len(self.radius) != (self.spheres or 1):
            raise ValueError(
                f"{len(self.radius)} radii for {self.spheres or 1} spheres: state one radius for all, or one"
                " for each"
            )
        return self

    @model_validator(mode="after")
    def _spheres_for_each_finger(self) -> ProbeParams:
        if self.grasp is not None and (self.spheres or 1) % self.grasp.fingers:
            raise ValueError(
                f"{self.spheres or 1} spheres on {self.grasp.fingers} fingers: every finger needs the same"
                " number of them"
            )
        return self

    @model_validator(mode="after")
    def _two_poles(self) -> ProbeParams:
        if self.energy is not None and self.energy.mode == "bipolar" and (self.spheres or 1) % 2:
            raise ValueError(
                f"{self.spheres or 1} spheres for bipolar energy: one half of them is one jaw, the other half"
                " the other jaw"
            )
        return self

    @model_validator(mode="after")
    def _two_jaws(self) -> ProbeParams:
        if self.clip is not None and (self.spheres or 1) % 2:
            raise ValueError(
                f"{self.spheres or 1} spheres for a clip: one half of them is one jaw, the other half the"
                " other jaw"
            )
        return self

    @model_validator(mode="after")
    def _spheres_at_the_ends_of_blades(self) -> ProbeParams:
        last = (self.spheres or 1) - 1
        for blade in self.edges:
            if not all(0 <= end <= last for end in blade) or blade[0] == blade[1]:
                raise ValueError(f"blade {list(blade)}: state two different spheres from 0 to {last}")
        if self.scissors and self.scissors.hinge not in {*range(last + 1)}.difference(*self.edges):
            raise ValueError(
                f"hinge {self.scissors.hinge}: state a sphere from 0 to {last} at no blade's end"
            )
        return self

    @property
    def edges(self) -> tuple[Edge, ...]:
        """All edges, those of scissors first."""
        pair = () if self.scissors is None else (self.scissors.left, self.scissors.right)
        return *pair, *self.blades

    @property
    def radii(self) -> Vector:
        """Radius (m) of every sphere, shape (n,)."""
        return np.full(self.spheres or 1, self.radius, dtype=np.float64)

    def coupling(
        self, contact_stiffness: float, contact_damping: float, timestep: float, *, sub_grid: bool = False
    ) -> Coupling:
        """Return the coupling as stated, completed by rule from the tissue and the sub-step (s).

        contact_stiffness: k_c of the tissue, N/m. contact_damping: ratio d of damping to stiffness of the
        tissue, s. A spring with reset returns more energy than stored, in cycles of frequency w at most the
        share w T k_c / k; the tissue's damping dissipates w d. So there is a reset if T <= 0.5 d k / k_c. No
        reset with `sub_grid`: the law counts the spring's yield.
        """
        ratio = _SUB_GRID_RATIO if sub_grid else _STIFFNESS_RATIO
        stiffness = self.stiffness or ratio * contact_stiffness
        mass = self.mass or stiffness * (timestep / _STEP_SHARE) ** 2
        reset = _RESET_SHARE * sqrt(mass / stiffness)
        passive = reset <= _PASSIVE_SHARE * contact_damping * stiffness / contact_stiffness
        least = _SOFTEST_SHARE * stiffness
        if passive and not sub_grid:  # softened, the spring with reset stays passive
            least = max(least, min(reset * contact_stiffness / (_PASSIVE_SHARE * contact_damping), stiffness))
        return Coupling(
            stiffness,
            mass,
            self.damping or 2.0 * sqrt(stiffness * mass),
            reset if passive and not sub_grid else None,
            least,
        )
