"""The electrode of cautery hooks and spatulas."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from robots.dvrk.end_effectors.end_effector import EndEffector, Mount
from robots.dvrk.end_effectors.probe import PROBE_RADIUS
from robots.dvrk.inertia import Inertia

__all__ = ["Electrode"]


@dataclass(frozen=True)
class Electrode(EndEffector):
    """A rigid tip in place of jaws, as heavy as a probe's sphere: no public model states the mass."""

    length: float = 0.0155
    """Distance of the end from the last joint's axis, m; without a public model: the length of the Cadiere
    forceps, as for jaws in `robots.dvrk.instruments`.
    """

    def bodies(self, mount: Mount, /) -> Mapping[str, Inertia]:
        """Return the electrode, in place of the wrist's last link."""
        return {mount.link: Inertia.of_steel_ball(mount.pose[:3, 3], PROBE_RADIUS)}
