"""Force against depth of a bond: one computation for the report and the page, live and recorded."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hub.recording.recording import Recording
from hub.recording.series import Series
from schemas.scenario import Bond, PortReference
from schemas.vectors import Vector

__all__ = ["CONTACT_SHARE", "BondTrace", "Contact", "read_bond_trace"]

CONTACT_SHARE = 0.05
"""Share of the peak force above which there is contact; a virtual coupling moved through air shows 2 % in the
palpation scenario.
"""
_GAP_S = 0.05
"""Longest interruption within a contact, s."""
_GROWN = 0.5
"""Share of the largest force of a contact; until then the force grows along the surface's normal. Later,
friction may tilt the force: in the drag of the palpation scenario by 12 degrees.
"""


@dataclass(frozen=True)
class Contact:
    """The samples of a bond from touch to release."""

    times_s: Vector
    """Shape (n,)."""
    depth: Vector
    """Displacement of the motion side since the touch, against the force as it grew, m, shape (n,)."""
    force: Vector
    """Magnitude of the force, N, shape (n,)."""

    def thin(self, most: int) -> Contact:
        """Return about `most` of the samples, with the deepest and the strongest among them."""
        count = len(self.times_s)
        if count <= most:
            return self
        evenly = np.linspace(0, count - 1, most).astype(int)
        kept = np.union1d(evenly, [np.argmax(self.depth), np.argmax(self.force)])
        return Contact(self.times_s[kept], self.depth[kept], self.force[kept])


@dataclass(frozen=True)
class BondTrace:
    """Position of the motion side of a bond, and force of the force side on the motion side."""

    name: str
    times_s: Vector
    """Shape (n,)."""
    position: NDArray[np.float64]
    """Position of the motion side, m, shape (n, 1 to 3)."""
    force: NDArray[np.float64]
    """Force on the motion side, N, shape (n, 1 to 3); NaN where values before a sample are missing."""

    @classmethod
    def of_series(
        cls, name: str, motion_s: Vector, places: Vector, force_s: Vector, forces: Vector
    ) -> BondTrace:
        """Return the trace at the times of the force; empty if there are no places.

        Args:
            name: Name of the bond.
            motion_s: Times of the motion side, s, shape (m,).
            places: Position and possibly more of the motion side, shape (m, 1 or more).
            force_s: Times of the force side, s, shape (n,).
            forces: Force and possibly more of the force side, shape (n, 1 or more).
        """
        if not len(motion_s):
            return cls(name, np.empty(0), np.empty((0, 3)), np.empty((0, 3)))
        dof = min(3, places.shape[1], forces.shape[1])
        position = [np.interp(force_s, motion_s, places[:, i]) for i in range(dof)]
        return cls(name, force_s, np.stack(position, axis=1), forces[:, :dof])

    @cached_property
    def magnitude(self) -> Vector:
        """Magnitude of the force, N, shape (n,)."""
        return np.linalg.norm(self.force, axis=1)

    @cached_property
    def peak(self) -> float:
        """Largest magnitude of the force, N."""
        return float(np.fmax.reduce(self.magnitude, initial=0.0))

    @cached_property
    def contacts(self) -> list[Contact]:
        """The contacts of two samples or more with a known beginning.

        Between the samples around a touch, force and position are taken as linear, so the depth hardly
        depends on how often the bond was sampled.
        """
        threshold = CONTACT_SHARE * self.peak
        return [
            Contact(self.times_s[part], depth, self.magnitude[part])
            for part in self._episodes(threshold)
            if (depth := self._depth(part, threshold)) is not None
        ]

    def _episodes(self, threshold: float) -> list[slice]:
        """Return the intervals above the threshold; short interruptions, and single samples, do not count."""
        inside = np.flatnonzero(self.magnitude > threshold) if threshold > 0.0 else np.zeros(0, int)
        if not inside.size:
            return []
        unknown = np.cumsum(np.isnan(self.magnitude))[inside]
        parted = (np.diff(inside) > 1) & (np.diff(self.times_s[inside]) > _GAP_S) | (np.diff(unknown) > 0)
        breaks = np.flatnonzero(parted)
        starts, ends = np.append(inside[0], inside[breaks + 1]), np.append(inside[breaks], inside[-1])
        return [slice(int(a), int(b) + 1) for a, b in zip(starts, ends, strict=True) if b > a]

    def _depth(self, part: slice, threshold: float) -> Vector | None:
        """Return the depth in an interval, m; None if the values before the interval are missing."""
        touch, first = self.position[part.start], self.magnitude[part.start]
        if part.start > 0:
            before = self.magnitude[part.start - 1]
            if np.isnan(before):
                return None
            share = (first - threshold) / (first - before)
            touch = touch + share * (self.position[part.start - 1] - touch)
        magnitude = self.magnitude[part]
        grown = 1 + int(np.argmax(magnitude >= _GROWN * np.nanmax(magnitude)))
        direction = self.force[part][:grown].mean(axis=0)
        return -(self.position[part] - touch) @ (direction / np.linalg.norm(direction))


def read_bond_trace(recording: Recording, bond: Bond) -> BondTrace | None:
    """Return both sides of `bond` at the times of the force; None if a side is not recorded."""
    motion = _first_series(recording, bond.motion, ("pose", "position"))
    force = _first_series(recording, bond.force, ("wrench", "force"))
    if motion is None or force is None:
        return None
    return BondTrace.of_series(bond.name, motion.time, motion.values, force.time, force.values)


def _first_series(recording: Recording, side: PortReference, names: Iterable[str]) -> Series | None:
    """Return the first recorded port among the ports `names` of a side of a bond."""
    ports = (f"{side.participant}.{side.port}/{name}" for name in names)
    return next((recording[port] for port in ports if port in recording), None)
