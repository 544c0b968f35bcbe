"""The electrode of cautery hooks and spatulas: a wire ahead of the wrist, its end perhaps bent aside."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from robots.dvrk.end_effectors.contact_sphere import ContactSphere
from robots.dvrk.end_effectors.end_effector import EndEffector, Mount
from robots.dvrk.end_effectors.probe import PROBE_RADIUS
from robots.dvrk.inertia import Inertia
from schemas.vectors import Vector

__all__ = ["Electrode"]


@dataclass(frozen=True)
class Electrode(EndEffector):
    """A rigid tip in place of jaws, as heavy as a probe's sphere. No public model states its measures."""

    length: float = 0.0155
    """Distance of the end from the last joint's axis, m; assumed: the length of the Cadiere forceps, as for
    jaws in `robots.dvrk.instruments`.
    """
    foot: float = 0.0
    """Length of the bent end, from the heel to the tip along -z of the last joint, m; 0: a straight end."""
    radius: float = 0.0006
    """Radius of the wire, m; assumed."""

    def bodies(self, mount: Mount, /) -> Mapping[str, Inertia]:
        """Return the electrode, in place of the wrist's last link."""
        return {mount.link: Inertia.of_steel_ball(mount.pose[:3, 3], PROBE_RADIUS)}

    sleeve: float = 0.00108
    """Radius of the insulated stem, m; assumed."""

    def spheres(self, tip: Vector, /) -> tuple[ContactSphere, ...]:
        """Return the bare end, then the insulated stem from there backwards, without gaps."""
        return *self.bare(tip), *self._stem(tip)

    def _stem(self, tip: Vector) -> Iterator[ContactSphere]:
        """Yield the spheres of the stem, up to the last joint's axis."""
        first = self.length - (2.0 * self.radius if self.foot else 6.0 * self.radius) - self.sleeve
        count = int(first / (2.0 * self.sleeve)) + 1
        for i in range(count):
            x, y, z = ((first - 2.0 * self.sleeve * i) * tip[:3, 2]).tolist()
            yield ContactSphere(f"stem_{i + 1}", "wrist_yaw", (x, y, z), self.sleeve)

    def bare(self, tip: Vector, /) -> tuple[ContactSphere, ...]:
        """Return the bare end: from heel to tip of a hook, else from the end backwards, without gaps."""
        end = (self.length - self.radius) * tip[:3, 2]
        along = np.array([0.0, 0.0, -1.0]) if self.foot else -tip[:3, 2]
        bare = self.foot or 6.0 * self.radius
        count = max(2, round((bare - 2.0 * self.radius) / (2.0 * self.radius)) + 1)
        ways = np.linspace(0.0, bare - 2.0 * self.radius, count).tolist()
        places = ((end + way * along).tolist() for way in ways)
        return tuple(
            ContactSphere(f"electrode_{i}", "wrist_yaw", (x, y, z), self.radius)
            for i, (x, y, z) in enumerate(places, 1)
        )
