"""The network link of a device, as a scenario states it: an emulated network between device and hub."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from schemas.quantity import Duration

__all__ = ["PRESETS", "NetworkLinkSpec", "Outage", "Preset"]

PRESETS = {
    0: "no way at all",
    70_000_000: "14 000 km of fibre",
    100_000_000: "20 000 km of fibre, half way round the earth",
    200_000_000: "that, and 100 ms for a mobile network or for coding of video",
    300_000_000: "a geostationary satellite (239 ms up and down at least)",
    500_000_000: "two hops over geostationary satellites",
}
"""Delay (ns) in each direction, and what has that delay.

Light goes through fibre at c / 1.468 (group index of G.652 fibre at 1550 nm), 204 km in a millisecond; a
geostationary satellite stands 35 786 km above the equator.
"""


def _preset(value: int) -> int:
    if value not in PRESETS:
        raise ValueError(
            f"{value / 1e6:g} ms is no preset, there are {', '.join(f'{ns // 10**6} ms' for ns in PRESETS)};"
            " any other delay is a 'delay'"
        )
    return value


_MEANINGS = "; ".join(f"{ns // 10**6} ms: {meaning}" for ns, meaning in PRESETS.items())

Preset = Annotated[Duration, AfterValidator(_preset)]


class Outage(BaseModel):
    """A time in which nothing gets through."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    at: Duration = Field(
        ge=0, description="since the session's start, or since the device joined if it lives in wall time"
    )
    duration: Duration = Field(gt=0)


class NetworkLinkSpec(BaseModel):
    """The way between a device and the hub, the same in both directions."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    preset: Preset | None = Field(default=None, description=f"a delay that stands for something: {_MEANINGS}")
    delay: Duration = Field(
        default=0,
        ge=0,
        le=10**10,
        description="shortest time on the way, in each direction: there and back takes twice as long",
    )
    jitter: Duration = Field(
        default=0,
        ge=0,
        le=10**10,
        description="each message takes up to this much longer, any time between as likely",
    )
    loss: float = Field(
        default=0.0, ge=0.0, lt=1.0, description="share of the messages that get lost, each by chance"
    )
    outages: tuple[Outage, ...] = Field(default=(), description="times in which nothing gets through")
    seed: int = Field(default=0, description="of the chance in jitter and loss: the same seed, the same way")

    @model_validator(mode="after")
    def _one_delay(self) -> Self:
        if self.preset is not None and self.delay:
            raise ValueError("a link has a preset or a delay, not both")
        return self

    @property
    def delay_ns(self) -> int:
        """The shortest time on the way."""
        return self.delay if self.preset is None else self.preset
