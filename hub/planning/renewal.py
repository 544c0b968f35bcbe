"""Participants that go on with other parameters from a step on: what a fork of a session changes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from hub.participant import Device, Stepped
from hub.planning import registry

__all__ = ["Renewal", "Successors", "made", "stages"]

Successors = Mapping[str, Sequence[tuple[int, Stepped]]]
"""By participant: who takes over its state, and before which step, the earliest first."""


class Renewal(BaseModel):
    """Before `step`, participants took the parameters that they have now, and kept their state."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    step: int = Field(gt=0)
    before: dict[str, dict[str, Any]]
    """The parameters that they had until then, by name."""

    def of(self, names: Iterable[str]) -> Renewal:
        """Return the part that concerns the participants `names`."""
        return Renewal(step=self.step, before={n: self.before[n] for n in names if n in self.before})


def stages(
    name: str, params: Mapping[str, Any], renewals: Iterable[Renewal]
) -> list[tuple[int, Mapping[str, Any]]]:
    """Return the parameters of participant `name` over a session, each with its first step.

    `params` are the last ones.
    """
    mine = sorted((one for one in renewals if name in one.before), key=lambda one: one.step)
    starts = [0, *(one.step for one in mine)]
    return list(zip(starts, [*(one.before[name] for one in mine), params], strict=True))


def made(
    kind: str, name: str, params: Mapping[str, Any], renewals: Iterable[Renewal], directory: Path
) -> tuple[Stepped | Device, list[tuple[int, Stepped]]]:
    """Return a participant as it starts, and those that take over from it.

    Raises ScenarioError if the kind cannot be loaded or parameters are invalid.
    """
    first, *later = (
        (step, registry.make(kind, name, given, directory)) for step, given in stages(name, params, renewals)
    )
    return first[1], [(step, one) for step, one in later if isinstance(one, Stepped)]
