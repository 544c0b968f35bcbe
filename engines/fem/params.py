"""Parameters of tissue in finite elements of our own."""

from __future__ import annotations

from typing import ClassVar

from pydantic import Field

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

    @property
    def changes_surfaces(self) -> bool:
        """Whether an organ may be divided or burnt."""
        divided = any(organ.cutting for organ in self.organs.values())
        return divided or any(probe.energy for probe in self.probes.values())
