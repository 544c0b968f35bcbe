"""Relaxation of tissue as a Prony series: shares of the shear modulus that fade, each with its time."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

__all__ = ["PronySeries", "PronyTerm"]

_MOST_TERMS = 3
_MOST_SHARE = 0.95
"""Largest sum of the shares: tissue is a solid."""


class PronyTerm(BaseModel):
    """A relaxing part of the shear modulus."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    share: float = Field(gt=0.0, lt=1.0, description="of the instantaneous shear modulus")
    seconds: float = Field(ge=1e-4, le=1e4, description="relaxation time")


def _leaves_a_solid(terms: tuple[PronyTerm, ...]) -> tuple[PronyTerm, ...]:
    total = sum(term.share for term in terms)
    if total > _MOST_SHARE:
        raise ValueError(f"the shares of a Prony series sum to at most {_MOST_SHARE:g}, not to {total:g}")
    return terms


PronySeries = Annotated[tuple[PronyTerm, ...], Field(max_length=_MOST_TERMS), AfterValidator(_leaves_a_solid)]
"""Up to three terms."""
