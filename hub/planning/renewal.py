"""Changes of parameters at a step: the difference between a fork and the parent."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, field_validator

from schemas.scenario import ParticipantSpec

__all__ = ["Renewal"]


class Renewal(BaseModel):
    """Before `step`, participants took their present parameters, and kept their state."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    step: int = Field(gt=0)
    before: dict[str, dict[str, Any]]
    """The earlier parameters, by name of participant."""

    @field_validator("before")
    @classmethod
    def _has_parameters_alone(cls, before: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
        """A kind or a host among the parameters would replace the participant's own."""
        for name, params in before.items():
            if other := sorted(params.keys() & set(ParticipantSpec.RESERVED)):
                raise ValueError(f"participant '{name}': {', '.join(other)} is no parameter of a kind")
        return before

    def of(self, names: Iterable[str]) -> Renewal:
        """Return the part for the participants `names`."""
        return Renewal(step=self.step, before={n: self.before[n] for n in names if n in self.before})
