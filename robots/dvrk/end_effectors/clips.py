"""Clips of the clip appliers, by the size in the instrument's name."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

__all__ = ["CLIPS", "Clip"]


@dataclass(frozen=True)
class Clip:
    """A clip for tubes."""

    diameters: tuple[float, float]
    """Least and largest outer diameter of a tube that it holds, m."""

    @property
    def length(self) -> float:
        """Length along the jaws, m: that of the largest tube, pressed flat; assumed."""
        return 0.5 * pi * self.diameters[1]


CLIPS = {
    "SMALL": Clip((2e-3, 4e-3)),
    "MEDIUM-LARGE": Clip((3.5e-3, 7e-3)),
    "LARGE": Clip((5e-3, 13e-3)),
}
"""Medium-large: titanium clips on arteries (Schenk et al., Innov. Surg. Sci. 1, 2016); small as medium there.
Large: range of polymer clips of this size, from memory of the manufacturer's table, not checked.
"""
