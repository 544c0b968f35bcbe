"""Parameters that tissue engines share: organs, rigid parts, probes, and steps."""

from __future__ import annotations

from typing import ClassVar, Self

from pydantic import Field, model_validator

from engines.tissue.elasticity.dense_body_yield import MOST_NODES
from engines.tissue.organs.anchors import WORLD, RigidParams
from engines.tissue.organs.params import OrganParams
from engines.tissue.probes.params import ProbeParams
from hub.participant import Surface, TissueParams
from schemas.errors import did_you_mean
from schemas.quantity import Acceleration, Duration
from schemas.scenario import Name

__all__ = ["PressedOrgansParams"]


class PressedOrgansParams(TissueParams):
    """Organs, probes, and numerics; an engine adds its own."""

    open_to_pages: ClassVar[bool] = True
    most_corrected_nodes: ClassVar[int] = MOST_NODES
    """Most nodes of organs whose force is corrected for their coarse mesh."""
    carrier_rule: ClassVar[str] = ""
    """Rule for probes to which organs may be anchored, as part of a message."""

    organs: dict[Name, OrganParams] = Field(min_length=1)
    rigid: dict[Name, RigidParams] = Field(
        default_factory=dict[Name, RigidParams],
        description="parts that do not move, and to which organs may be anchored",
    )
    probes: dict[Name, ProbeParams] = Field(default_factory=lambda: {"probe": ProbeParams()})
    node_period: Duration = Field(
        default=16_000_000, gt=0, description="how often the nodes are output; a multiple of the period"
    )
    gravity: Acceleration = Field(
        default=9.80665, ge=0, description="along -z of `world`; default: standard gravity"
    )
    sub_grid: bool = Field(
        default=True,
        description=(
            "whether a probe of one sphere feels the force of the tissue rather than of its coarse mesh, on"
            " anchored organs of at most 1200 nodes, with kind fem 3500"
        ),
    )

    @property
    def bodies(self) -> dict[str, Surface]:
        """The organs at rest."""
        return {name: Surface(organ.rest.nodes, organ.rest.triangles) for name, organ in self.organs.items()}

    def contact_stiffness(self, probe: str) -> float:
        """Return the largest contact stiffness (N/m) of a probe's spheres on the organs' meshes."""
        return max(
            organ.contact_stiffness(radius)
            for organ in self.organs.values()
            for radius in self.probes[probe].radii.tolist()
        )

    def has_sub_grid(self, probe: str) -> bool:
        """Return whether a probe of a single sphere feels the tissue's own force on every organ."""
        given = self.probes[probe]
        return (
            self.sub_grid and given.spheres in (None, 1) and given.grasp is None and self._is_compliance_known
        )

    def has_series(self, probe: str) -> bool:
        """Return whether a spring is in series with a probe: under a single sphere, or in a jaw's bite."""
        grasp = self.probes[probe].grasp
        return self.has_sub_grid(probe) or (grasp is not None and grasp.width is not None)

    @property
    def _is_compliance_known(self) -> bool:
        return all(
            organ.cutting is None  # the spring in series is that of the whole organ
            and not organ.layers
            and len(organ.rest.nodes) <= self.most_corrected_nodes
            and any(tied.any() for tied in organ.anchored_nodes.values())
            for organ in self.organs.values()
        )

    @model_validator(mode="after")
    def _has_compliance_for_jaws(self) -> Self:
        for name, probe in self.probes.items():
            if probe.grasp and probe.grasp.width is not None and not self._is_compliance_known:
                raise ValueError(
                    f"probe '{name}': grasp.width needs organs that are anchored, are not cut, and have at"
                    f" most {self.most_corrected_nodes} nodes; leave it out, and a pull is that of the mesh"
                )
        return self

    @model_validator(mode="after")
    def _known_parts(self) -> Self:
        known = [WORLD, *self.rigid, *self.carriers]
        for name, organ in self.organs.items():
            for part in organ.anchored_nodes:
                if part not in known:
                    raise ValueError(
                        f"organ '{name}' is anchored to '{part}', which is not a rigid"
                        f" part{self.carrier_rule}.{did_you_mean(part, known)}"
                    )
        return self

    @property
    def carriers(self) -> tuple[str, ...]:
        """Names of the probes to which organs may be anchored."""
        return ()
