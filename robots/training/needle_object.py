"""The needle of a scene for participants beside the engine: the shape of the wire."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from robots.training.needles import DEFAULT, NEEDLES, NeedleName, NeedleShape
from robots.training.threads import ThreadParams
from schemas.quantity import Angle, Length

__all__ = ["NeedleObject", "needles_of"]


class NeedleObject(BaseModel):
    """Wire of an object of kind `needle`; other parameters belong to the engine."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    needle: NeedleName = Field(default=DEFAULT, description="whose measures the wire has where none is given")
    radius: Length | None = Field(default=None, gt=0.0, description="of the centre line")
    wire_radius: Length | None = Field(default=None, gt=0.0, description="of the cross-section")
    arc: Angle | None = Field(default=None, gt=0.0, description="from end to end")
    thread: ThreadParams | None = Field(default=None, description="behind its base; null: none")

    @property
    def shape(self) -> NeedleShape:
        """Shape of the wire."""
        named = NEEDLES[self.needle]
        return NeedleShape(
            radius=self.radius or named.radius,
            arc=self.arc or named.arc,
            wire_radius=self.wire_radius or named.wire_radius,
            middle=0.0 if self.arc else named.middle,
        )


def needles_of(objects: Mapping[str, Mapping[str, Any]]) -> dict[str, NeedleObject]:
    """Return the needles among the objects of a scene, by name."""
    return {
        name: NeedleObject.model_validate(thing)
        for name, thing in objects.items()
        if thing.get("kind") == "needle"
    }
