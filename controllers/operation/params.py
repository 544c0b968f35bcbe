"""Parameters of the routine of the whole operation."""

from __future__ import annotations

from typing import Any, Self

from pydantic import Field, model_validator

from controllers.cholecystectomy.params import ClipAndCutParams
from controllers.cholecystectomy.routine_params import RoutineParams
from controllers.dissection.params import DissectionParams
from controllers.motion.params import PsmParams
from robots.dvrk.end_effectors.electrode import Electrode
from robots.dvrk.parameters import ArmName
from schemas.scenario import Name

__all__ = ["OperationParams"]


class OperationParams(RoutineParams):
    """Arms and their instruments, and the organs that they keep away from."""

    hook: ArmName = Field(
        default="PSM1", description="the arm with a cautery hook, and a clip applier as its first spare"
    )
    scissors: ArmName = Field(default="PSM3", description="the arm with the scissors")
    avoid: tuple[Name, ...] = Field(
        default=("liver", "cystic_duct", "cystic_artery", "common_bile_duct", "hepatic_artery"),
        max_length=16,
        description="organs that shafts and jaws keep away from where they can",
    )
    clip_avoid: tuple[Name, ...] = Field(
        default=("liver", "gallbladder", "common_bile_duct", "hepatic_artery"),
        max_length=16,
        description="the same while tubes are clipped and cut",
    )

    @property
    def variants(self) -> list[PsmParams]:
        """The hook's arm with the hook, and with the clip applier. Raises ValueError without both."""
        arm = self.arms.present_arms.get(self.hook)
        found = list(arm.variants[:2]) if isinstance(arm, PsmParams) else []
        if [isinstance(one.end_effector, Electrode) for one in found] != [True, False]:
            raise ValueError(f"{self.hook} needs a cautery hook, and in `spares`, first, a clip applier")
        return found

    @property
    def applier(self) -> str:
        """Name of the clip applier in the tissue."""
        arm = self.arms.present_arms[self.hook]
        return list(arm.by_owner(self.hook))[1].replace("/", "_")

    @property
    def triangle(self) -> DissectionParams:
        """Fat over the triangle and the lower third of the plate."""
        return DissectionParams(**self._common(0), hook=self.hook, part="lower third", avoid=self.avoid)

    @property
    def clips(self) -> ClipAndCutParams:
        """Clips on both tubes, and cuts."""
        return ClipAndCutParams(
            **self._common(1), applier=self.hook, scissors=self.scissors, avoid=self.clip_avoid
        )

    @property
    def bed(self) -> DissectionParams:
        """The rest of the plate."""
        return DissectionParams(**self._common(0), hook=self.hook, fat=(), avoid=self.avoid[:1])

    def _common(self, variant: int) -> dict[str, Any]:
        arms = self.arms.model_copy(update={self.hook: self.variants[variant]})
        return {
            "arms": arms,
            "mounting": self.mounting,
            "setup_joints": self.setup_joints,
            "grasper": self.grasper,
            "gallbladder": self.gallbladder,
        }

    @model_validator(mode="after")
    def _is_a_team(self) -> Self:
        assert self.triangle
        assert self.clips
        return self
