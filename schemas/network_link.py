"""The network link of a device in a scenario: the effects of a network between the device and the hub."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from schemas.quantity import Duration

__all__ = ["PRESETS", "NetworkLinkSpec", "Outage", "Preset"]

PRESETS = {
    0: "no delay",
    70_000_000: "14 000 km of fibre",
    100_000_000: "20 000 km of fibre, half way round the earth",
    200_000_000: "the same, and 100 ms for a mobile network or for video coding",
    300_000_000: "a geostationary satellite (239 ms up and down at least)",
    500_000_000: "two hops over geostationary satellites",
}
"""Delay (ns) in each direction, and a typical cause of it.

Light travels in fibre at c / 1.468 (group index of G.652 fibre at 1550 nm), 204 km in a millisecond; a
geostationary satellite is 35 786 km above the equator.
"""


def _preset_values(value: int) -> int:
    if value not in PRESETS:
        raise ValueError(
            f"{value / 1e6:g} ms is no preset; these are {', '.join(f'{ns // 10**6} ms' for ns in PRESETS)}."
            " For any other delay, use 'delay'"
        )
    return value


_MEANINGS = "; ".join(f"{ns // 10**6} ms: {meaning}" for ns, meaning in PRESETS.items())

Preset = Annotated[Duration, AfterValidator(_preset_values)]


class Outage(BaseModel):
    """A time in which all messages are lost."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    at: Duration = Field(
        ge=0, description="since the session's start, or since the device joined if it lives in wall time"
    )
    duration: Duration = Field(gt=0)


class NetworkLinkSpec(BaseModel):
    """The emulated network between a device and the hub, the same in both directions."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    preset: Preset | None = Field(default=None, description=f"a typical delay: {_MEANINGS}")
    delay: Duration = Field(
        default=0,
        ge=0,
        le=10**10,
        description="shortest delay in each direction; a round trip takes twice as long",
    )
    jitter: Duration = Field(
        default=0,
        ge=0,
        le=10**10,
        description="the most that a message is delayed longer, uniformly distributed",
    )
    loss: float = Field(
        default=0.0, ge=0.0, lt=1.0, description="share of the messages that are lost, at random"
    )
    outages: tuple[Outage, ...] = Field(default=(), description="times in which all messages are lost")
    seed: int = Field(
        default=0, description="of the random numbers of jitter and loss: the same seed gives the same link"
    )

    @model_validator(mode="after")
    def _one_delay(self) -> Self:
        if self.preset is not None and self.delay:
            raise ValueError("a network link has a preset or a delay, not both")
        return self

    @property
    def delay_ns(self) -> int:
        """The shortest delay in each direction (ns)."""
        return self.delay if self.preset is None else self.preset
