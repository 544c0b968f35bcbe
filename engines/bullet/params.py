"""Parameters of tissue in Bullet: its sub-step, and its start."""

from __future__ import annotations

from functools import cached_property
from typing import ClassVar, Self

from pydantic import Field, model_validator

from engines.bullet.elasticity.stable_step import longest_step
from engines.tissue.params import PressedOrgansParams
from schemas.quantity import Duration

__all__ = ["BulletParams"]

_LONGEST_NS, _HALVES = 1_000_000, 4
"""Longest default sub-step, and most halvings; 62.5 us are far from real time."""


class BulletParams(PressedOrgansParams):
    """Tissue in Bullet."""

    unused_of_tools: ClassVar[frozenset[str]] = frozenset({"energy", "clip", "suction", "irrigation"})

    timestep: Duration | None = Field(
        default=None,
        ge=10_000,
        description=(
            "sub-step; the period is a multiple of it; default: 1 ms, halved until all organs are stable"
        ),
    )
    standstill: bool = Field(
        default=True,
        description=(
            "whether what still moves when the organs have settled is stopped, so that their start can be"
            " restored; recordings of version 0.1.0 are without"
        ),
    )

    @model_validator(mode="after")
    def _does_not_relax(self) -> Self:
        for name, organ in self.organs.items():
            if organ.prony:
                raise ValueError(
                    f"organ '{name}': the material of kind bullet does not relax: leave prony out, or take"
                    " kind fem"
                )
        return self

    @cached_property
    def sub_step(self) -> int:
        """The sub-step, ns: as stated, or the longest stable sub-step among 1 ms and its halves."""
        if self.timestep is not None:
            return self.timestep
        limit = min(
            longest_step(organ.frequencies[0], organ.elastic.damping) for organ in self.organs.values()
        )
        halves = (_LONGEST_NS >> i for i in range(_HALVES + 1))
        return next((step for step in halves if step <= limit * 1e9), _LONGEST_NS >> _HALVES)

    @model_validator(mode="after")
    def _what_fem_alone_has(self) -> Self:
        for name, probe in self.probes.items():
            if probe.energy is not None:
                raise ValueError(f"probe '{name}': energy heats tissue of kind fem only; leave it out here")
            for what in ("suction", "irrigation"):
                if getattr(probe, what) is not None:
                    raise ValueError(f"probe '{name}': {what} is for kind fem only; leave it out here")
            if probe.clip is not None:
                raise ValueError(f"probe '{name}': clips hold tissue of kind fem only; leave it out here")
            if probe.blades:
                raise ValueError(f"probe '{name}': blades cut tissue of kind fem only; leave them out here")
        for name, organ in self.organs.items():
            if organ.layers:
                raise ValueError(
                    f"organ '{name}': only tissue of kind fem has layers; leave `layers` out here"
                )
            if organ.lumen is not None:
                raise ValueError(f"organ '{name}': only kind fem has a lumen; leave `lumen` out here")
            if organ.cutting is not None:
                raise ValueError(f"organ '{name}': only tissue of kind fem is cut; leave `cutting` out here")
        return self
