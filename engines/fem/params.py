"""Parameters of tissue in finite elements of our own."""

from __future__ import annotations

from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from anatomy.params import AnatomyParams
from engines.fem.anatomy import add_anatomy
from engines.fem.attachments.params import AttachmentParams
from engines.tissue.elasticity.body_yield import MOST_NODES
from engines.tissue.organs.params import OrganParams
from engines.tissue.params import PressedOrgansParams
from schemas.errors import did_you_mean
from schemas.quantity import Duration
from schemas.scenario import Name

__all__ = ["FemParams"]


class FemParams(PressedOrgansParams):
    """Tissue in explicit dynamics."""

    bears_exchanges: ClassVar[bool] = True
    most_corrected_nodes: ClassVar[int] = MOST_NODES
    carrier_rule: ClassVar[str] = ", nor a probe with `spheres: 1`"

    anatomy: AnatomyParams | None = Field(
        default=None,
        description=(
            "a patient, whose organs and attachments are added; `organs` and `attachments` of the same names"
            " change single fields"
        ),
    )
    seed: int | None = Field(
        default=None, ge=0, le=2**53, description="draws the patient where `anatomy` states none"
    )
    organs: dict[Name, OrganParams] = Field(default_factory=dict[Name, OrganParams])

    timestep: Duration | None = Field(
        default=None,
        ge=10_000,
        description="longest sub-step; the mesh may need shorter ones, which the engine works out",
    )

    own_sub_steps: bool = Field(
        default=False,
        description=(
            "whether soft organs have longer sub-steps than stiff ones beside them, by powers of two: cheaper"
            " where small stiff tubes lie beside large organs"
        ),
    )

    organ_contact: bool = Field(
        default=True,
        description=(
            "whether organs touch one another and themselves, also the sides of a cut; the smaller of their"
            " frictions counts"
        ),
    )

    attachments: dict[Name, AttachmentParams] = Field(
        default_factory=dict[Name, AttachmentParams],
        description=(
            "connective tissue between organs, with outputs `<attachment>/freed` and `<attachment>/force`"
        ),
    )

    @model_validator(mode="before")
    @classmethod
    def _add_anatomy(cls, given: Any) -> Any:
        return add_anatomy(given)

    @model_validator(mode="after")
    def _has_organs(self) -> Self:
        if not self.organs:
            raise ValueError("tissue has organs: state `organs`, or a patient's `anatomy`")
        return self

    @model_validator(mode="after")
    def _organs_to_attach(self) -> Self:
        for name, attachment in self.attachments.items():
            for organ in attachment.organs:
                if organ not in self.organs:
                    raise ValueError(
                        f"attachment '{name}': there is no organ '{organ}'.{did_you_mean(organ, self.organs)}"
                    )
            if name in self.organs or name in self.probes:
                raise ValueError(f"attachment '{name}' has the name of an organ or a probe: take another")
        if self.attachments and not self.organ_contact:
            raise ValueError("attachments part, and then the organs touch: leave organ_contact on")
        return self

    @model_validator(mode="after")
    def _something_to_suck(self) -> Self:
        organs = self.organs.values()
        for name, probe in self.probes.items():
            if any(organ.bleeding or organ.lumen for organ in organs):
                continue
            for what in ("suction", "irrigation"):
                if getattr(probe, what) is not None:
                    raise ValueError(
                        f"probe '{name}': {what} finds no blood: no organ has `bleeding` or `lumen`"
                    )
        return self

    @model_validator(mode="after")
    def _one_meaning_of_parts(self) -> Self:
        if twice := self.rigid.keys() & {*self.carriers}:
            raise ValueError(f"'{min(twice)}' is a rigid part and a probe: take another name for one of them")
        return self

    @property
    def carriers(self) -> tuple[str, ...]:
        """Names of the probes to which organs may be anchored: of one sphere, a point that moves."""
        return tuple(name for name, probe in self.probes.items() if probe.spheres == 1)

    def carried(self, probe: str) -> dict[str, NDArray[np.bool_]]:
        """Return the nodes that a probe carries, by organ, shape (n,); empty for one that presses."""
        if probe not in self.carriers:
            return {}
        anchors = {name: organ.anchored_nodes for name, organ in self.organs.items()}
        return {name: parts[probe] for name, parts in anchors.items() if probe in parts}

    def contact_stiffness(self, probe: str) -> float:
        """Return the largest stiffness (N/m) against a probe's spheres, or its carried nodes."""
        if not (carried := self.carried(probe)):
            return super().contact_stiffness(probe)
        return sum(self.organs[name].patch_stiffness(nodes) for name, nodes in carried.items())

    @property
    def may_lean(self) -> bool:
        """Whether organs may lean on a rigid part that anchors none of them."""
        return not self.rigid.keys() <= {part for one in self.organs.values() for part in one.anchored_nodes}

    def has_sub_grid(self, probe: str) -> bool:
        """Return whether a probe feels the tissue's own force: not where organs may lean on rigid parts.

        A probe that carries a surface has no spring either. The spring in series knows the organ on its
        anchors alone.
        """
        return not self.may_lean and not self.carried(probe) and super().has_sub_grid(probe)

    @cached_property
    def changes_surfaces(self) -> bool:
        """Whether an organ may be divided, burnt, clipped or detached."""
        if self.attachments:
            return True
        divided = any(organ.cutting or organ.lumen for organ in self.organs.values())
        return divided or any(probe.energy for probe in self.probes.values())
