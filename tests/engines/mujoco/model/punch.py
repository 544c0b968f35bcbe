"""A toy end effector, as a stranger would add it: one file, and nothing else knows of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from robots.dvrk.drive import Drive
from robots.dvrk.end_effectors.contact_sphere import ContactSphere
from robots.dvrk.end_effectors.end_effector import EndEffector, Motor, Mount
from robots.dvrk.inertia import STEEL_DENSITY, Inertia
from robots.dvrk.link import Link
from robots.serial_chain import Joint
from schemas.vectors import Vector

__all__ = ["Punch"]


@dataclass(frozen=True)
class Punch(EndEffector):
    """A steel pin that slides out of the wrist along the tip's z axis."""

    travel: float = 8e-3
    """m."""
    radius: float = 1e-3
    """Radius of the pin, m."""
    length: float = 10e-3
    """m."""

    name: ClassVar[str] = "punch"
    goal: ClassVar[str] = "goal of the pin"

    @property
    def joints(self) -> tuple[Joint, ...]:
        """The pin's way, m."""
        limits = {"velocity": 0.02, "effort": 5.0, "acceleration": 0.2, "jerk": 2.0}
        return (Joint("pin", "prismatic", 0.0, 0.0, 0.0, 0.0, 0.0, self.travel, **limits),)

    @property
    def motors(self) -> tuple[Motor, ...]:
        """A disc with a pulley of 10 mm."""
        drive = Drive.of_disc(10e-3**-2, self.joints[0].effort, self.joints[0].velocity)
        return (Motor("pin", "pin", "gear", drive, {"pin": 1.0}),)

    def links(self, mount: Mount, /) -> tuple[Link, ...]:
        """Return the pin."""
        pose = mount.pose.copy()
        pose[:3, :3] = np.column_stack([mount.axis, np.cross(mount.ahead, mount.axis), mount.ahead])
        return (Link("pin", mount.link, "prismatic", pose, 0.0, self.travel),)

    def bodies(self, mount: Mount, /) -> Mapping[str, Inertia]:
        """Return the pin."""
        start, mass = mount.pose[:3, 3], STEEL_DENSITY * np.pi * self.radius**2 * self.length
        return {"pin": Inertia.of_rod(mass, start, start + self.length * mount.ahead, self.radius)}

    def spheres(self, _tip: Vector, /) -> tuple[ContactSphere, ...]:
        """Return the pin's round end."""
        return (ContactSphere("pin", "pin", (0.0, 0.0, self.length), self.radius),)
