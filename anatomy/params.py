"""Parameters of a patient in a scenario."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from anatomy.organs import attachments_of, organs_of
from anatomy.patient import ArteryCourse, Patient, Variations, draw_patient
from anatomy.phase import Phase

__all__ = ["AnatomyParams"]


class AnatomyParams(BaseModel):
    """A patient, and how far the operation has gone."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    patient: int | None = Field(
        default=None,
        ge=0,
        le=2**53,
        description="seed of sizes, stiffness and variations; default: the `seed` of the scene, else 0",
    )
    phase: Phase = Field(
        default="clip-and-cut",
        description=(
            "calot-dissection: fat and peritoneum lie over the triangle; clip-and-cut: it is dissected, the"
            " lower third of the cystic plate is free; gallbladder-bed: duct and artery have been divided;"
            " cholecystectomy: all, from the fat on, with a liver that may be cut and bleeds"
        ),
    )
    artery: ArteryCourse | None = Field(
        default=None, description="course of the cystic artery about the duct; default: as the seed draws it"
    )
    short_duct: bool | None = Field(
        default=None, description="a cystic duct of 10 to 14 mm; default: as the seed draws it"
    )
    thick_wall: bool | None = Field(
        default=None, description="an inflamed gallbladder; default: as the seed draws it"
    )
    stone: bool | None = Field(
        default=None,
        description="a stone fills the neck of the gallbladder; default: as the seed draws it",
    )

    @property
    def drawn(self) -> Patient:
        """The patient."""
        stated = Variations(self.artery, self.short_duct, self.thick_wall, self.stone)
        return draw_patient(self.patient or 0, stated)

    @property
    def organs(self) -> dict[str, dict[str, Any]]:
        """The organs by name, as a scenario states them."""
        return organs_of(self.drawn, self.phase)

    @property
    def attachments(self) -> dict[str, dict[str, Any]]:
        """The attachments by name, as a scenario states them."""
        return attachments_of(self.drawn, self.phase)
