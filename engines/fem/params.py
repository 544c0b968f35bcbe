"""Parameters of tissue in finite elements of our own."""

from __future__ import annotations

from functools import cached_property
from typing import ClassVar, Self

from pydantic import Field, model_validator

from engines.tissue.elasticity.body_yield import MOST_NODES
from engines.tissue.params import PressedOrgansParams
from schemas.quantity import Duration

__all__ = ["FemParams"]


class FemParams(PressedOrgansParams):
    """Tissue in explicit dynamics."""

    most_corrected_nodes: ClassVar[int] = MOST_NODES

    timestep: Duration | None = Field(
        default=None,
        ge=10_000,
        description="longest sub-step; the mesh may need shorter ones, which the engine works out",
    )

    organ_contact: bool = Field(
        default=True,
        description=(
            "whether organs touch one another and themselves, also the sides of a cut; the smaller of their"
            " frictions counts"
        ),
    )

    @model_validator(mode="after")
    def _something_to_suck(self) -> Self:
        organs = self.organs.values()
        for name, probe in self.probes.items():
            if probe.suction and not any(organ.bleeding or organ.lumen for organ in organs):
                raise ValueError(
                    f"probe '{name}': suction finds no blood: no organ has `bleeding` or `lumen`"
                )
        return self

    @property
    def may_lean(self) -> bool:
        """Whether organs may lean on a rigid part that anchors none of them."""
        return not self.rigid.keys() <= {part for one in self.organs.values() for part in one.anchored_nodes}

    def has_sub_grid(self, probe: str) -> bool:
        """Return whether a probe feels the tissue's own force: not where organs may lean on rigid parts.

        The spring in series knows the organ on its anchors alone.
        """
        return not self.may_lean and super().has_sub_grid(probe)

    @cached_property
    def changes_surfaces(self) -> bool:
        """Whether an organ may be divided, burnt or clipped."""
        divided = any(organ.cutting or organ.lumen for organ in self.organs.values())
        return divided or any(probe.energy for probe in self.probes.values())
