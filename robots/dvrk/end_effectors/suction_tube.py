"""The tip of a suction irrigator: a rigid tube ahead of the wrist, open at its end and at holes beside it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from robots.dvrk.end_effectors.contact_sphere import ContactSphere
from robots.dvrk.end_effectors.end_effector import EndEffector, Mount
from robots.dvrk.end_effectors.probe import PROBE_RADIUS
from robots.dvrk.inertia import Inertia
from schemas.vectors import Vector

__all__ = ["SuctionTube"]


@dataclass(frozen=True)
class SuctionTube(EndEffector):
    """A rigid tube in place of jaws, as heavy as a probe's sphere. No public model states its measures."""

    length: float = 0.021
    """Distance of the open end from the last joint's axis, m; assumed: the length of Maryland forceps."""
    radius: float = 0.0025
    """Outer radius, m: a tube of 5 mm, as of laparoscopic suction irrigators."""
    bore: float = 0.0017
    """Inner radius, m; assumed."""

    def bodies(self, mount: Mount, /) -> Mapping[str, Inertia]:
        """Return the tube, in place of the wrist's last link."""
        return {mount.link: Inertia.of_steel_ball(mount.pose[:3, 3], PROBE_RADIUS)}

    def spheres(self, tip: Vector, /) -> tuple[ContactSphere, ...]:
        """Return spheres from the open end backwards, without gaps, up to the last joint's axis."""
        first = self.length - self.radius
        places = [first - 2.0 * self.radius * i for i in range(int(first / (2.0 * self.radius)) + 1)]
        at = ((place * tip[:3, 2]).tolist() for place in places)
        return tuple(
            ContactSphere(f"tube_{i}", "wrist_yaw", (x, y, z), self.radius)
            for i, (x, y, z) in enumerate(at, 1)
        )
