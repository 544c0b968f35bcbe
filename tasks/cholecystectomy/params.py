"""Parameters of the cholecystectomy task: the goals of a phase, and limits of good clips and cuts."""

from __future__ import annotations

from typing import ClassVar, Self

from pydantic import Field, model_validator

from anatomy.phase import Phase
from schemas.quantity import Angle, Duration, Length
from tasks.params import TaskParams

__all__ = ["CholecystectomyParams"]


class CholecystectomyParams(TaskParams):
    """Goals, and limits of clips, cuts and harm."""

    open_to_pages: ClassVar[bool] = True

    phase: Phase = Field(
        default="clip-and-cut", description="of the operation: its goals are those of the task"
    )
    clips: int = Field(
        default=3,
        ge=1,
        le=8,
        description="on each tube; default: as in the data set ImitateCholec (Kim et al., Sci. Data, 2025)",
    )
    stays: int = Field(default=2, ge=1, le=8, description="of these, clips that stay with the patient")
    clip_distance: Length = Field(
        default=2e-3, ge=0, description="least distance of the middles of two clips; customary"
    )
    cuff: Length = Field(
        default=1e-3,
        ge=0,
        description=(
            "least tissue between a cut and the next clip; default: safe with polymer clips across a vessel"
            " (Oxford, publication 414045)"
        ),
    )
    stump: Length = Field(
        default=5e-3, ge=0, description="least distance of a clip from the common duct; customary"
    )
    tilt: Angle = Field(
        default=0.5236,
        gt=0,
        lt=1.5708,
        description="most by which a clip may lie off square to its tube; ours",
    )
    idle_power: Duration = Field(
        default=200_000_000, gt=0, description="power without contact for so long is an error; ours"
    )
    blood_limit: float = Field(
        default=50.0,
        gt=0,
        description="ml of blood beyond which the operation has failed; ours (usual: 5 to 20 ml)",
    )

    @property
    def probes(self) -> dict[str, tuple[str, ...]]:
        """Probes in tissue of each arm with instruments: the mounted one, and each spare."""
        owners = {arm: self.arms[arm].by_owner(arm) for arm in self.psms}
        return {arm: tuple(owner.replace("/", "_") for owner in own) for arm, own in owners.items()}

    @model_validator(mode="after")
    def _room_for_a_cut(self) -> Self:
        if self.stays > self.clips:
            raise ValueError(f"stays: {self.stays} of {self.clips} clips cannot stay with the patient")
        return self
