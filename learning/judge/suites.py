"""Suites: which exercises a policy is judged on."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from learning.environments.registration import ENVIRONMENTS
from learning.judge.operations import OPERATIONS
from schemas.errors import ScenarioError, did_you_mean

__all__ = ["SUITES", "exercises_of"]

_TRAINING = ("Reach", "PegTransfer", "BiPegTransfer", "PickAndPlace")
_SUTURING = ("NeedlePick", "NeedleHandOver")
_TISSUE = ("Retraction", "TissueCut", "Dissect")

SUITES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "training": _TRAINING,
        "suturing": _SUTURING,
        "tissue": _TISSUE,
        "all": (*_TRAINING, *_SUTURING, *_TISSUE),
        "operation": tuple(OPERATIONS),
    }
)
"""Exercises by the name of a suite; `all` is without operations, of which each trial takes minutes."""


def exercises_of(text: str) -> tuple[str, ...]:
    """Return the exercises of suites and exercises named with commas. Raises ScenarioError."""
    known = [name.removeprefix("trocar/").removesuffix("-v0") for name in ENVIRONMENTS] + [*OPERATIONS]
    found: list[str] = []
    for name in (part.strip() for part in text.split(",")):
        if name not in SUITES and name not in known:
            raise ScenarioError(
                f"no suite and no exercise '{name}'.{did_you_mean(name, [*SUITES, *known])} Suites:"
                f" {', '.join(SUITES)}; exercises: {', '.join(known)}"
            )
        found += SUITES.get(name, (name,))
    return tuple(dict.fromkeys(found))
