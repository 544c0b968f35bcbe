"""The palpation probe: a steel sphere in place of jaws."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from robots.dvrk.end_effectors.end_effector import EndEffector, Mount
from robots.dvrk.inertia import Inertia

__all__ = ["PROBE_RADIUS", "Probe"]

PROBE_RADIUS = 5e-3
"""Radius of the sphere, m, unless the scene states another."""


@dataclass(frozen=True)
class Probe(EndEffector):
    """A steel sphere centred on the tip frame."""

    radius: float = PROBE_RADIUS
    """m."""

    def bodies(self, mount: Mount, /) -> Mapping[str, Inertia]:
        """Return the sphere, in place of the wrist's last link."""
        return {mount.link: Inertia.of_steel_ball(mount.pose[:3, 3], self.radius)}
