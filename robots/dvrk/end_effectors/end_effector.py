"""The protocol of end effectors: the numbers of the working end of an instrument.

An end effector has commanded *joints*, *motors*, moving *links* with masses, and contact spheres. An engine
builds the model from these numbers alone, so a new end effector is a file in this package and a row in
`robots.dvrk.instruments`. SI units, radians.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from robots.dvrk.drive import Drive
from robots.dvrk.end_effectors.contact_sphere import ContactSphere
from robots.dvrk.inertia import Inertia
from robots.dvrk.link import Link
from robots.serial_chain import Joint, SerialChain
from schemas.plain_sum import plain_sum
from schemas.vectors import Vector

__all__ = ["EndEffector", "Motor", "Mount"]


@dataclass(frozen=True)
class Mount:
    """Link under an end effector; poses in the arm's base frame with every joint at 0."""

    link: str
    pose: Vector
    """Pose of the link, shape (4, 4)."""
    tip: Vector
    """Pose of the instrument's tip frame, shape (4, 4)."""

    @classmethod
    def on(cls, chain: SerialChain) -> Mount:
        """Return the last link of `chain`."""
        frames = chain.frames(np.zeros(len(chain.joints)))
        return cls(chain.joints[-1].name, frames[-2], frames[-1])

    @property
    def ahead(self) -> Vector:
        """Direction from the link to the tip, shape (3,)."""
        return self.tip[:3, 2]

    @property
    def axis(self) -> Vector:
        """Direction of the link's joint, shape (3,)."""
        return self.pose[:3, 2]


@dataclass(frozen=True)
class Motor:
    """A servo: its position is the sum over the links in `moves` of factor * joint position.

    Kinds:
        disc: the instrument's fourth disc turns one link; friction belongs to the discs.
        gear: the links move as one, by equal amounts, tied by a constraint called `tie`.
        tendon: pulls the links against their springs, and pushes by no more than its rotor.
        spring: sets where the spring in the joint of one link is at rest.

    The links of a disc are measured at their joints; all other motors at the motor.
    """

    name: str
    joint: str
    """Commanded joint served by this motor."""
    kind: Literal["disc", "gear", "tendon", "spring"]
    drive: Drive
    moves: Mapping[str, float]
    """Motor position per joint position, by link."""
    share: float = 1.0
    """Setpoint of the motor over setpoint of the joint."""
    tie: str = ""

    @property
    def ratio(self) -> float:
        """Position of the links over position of the joint, where all links move by equal amounts."""
        return self.share / plain_sum(self.moves.values())


class EndEffector:
    """An end effector without joints and without mass: the base of all end effectors."""

    name: ClassVar[str] = ""
    """Second part of the names of ports, `<arm>/<name>/servo_jp`."""
    goal: ClassVar[str] = ""
    """Meaning of `servo_jp`, in words."""
    measured: ClassVar[str] = ""
    """Meaning of `measured_js`, in words, where more than the positions of the joints."""

    @property
    def joints(self) -> tuple[Joint, ...]:
        """Commanded joints: their ranges and limits."""
        return ()

    @property
    def motors(self) -> tuple[Motor, ...]:
        """Servos of the links, in the order of the model's actuators."""
        return ()

    def links(self, _mount: Mount, /) -> tuple[Link, ...]:
        """Return the moving links on their mount, parents before children."""
        return ()

    def positions(self, command: Vector) -> Mapping[str, float]:
        """Return the position of each link at rest, free of contact, at a command, shape (joints,).

        By default the links of a motor move by equal amounts.
        """
        commands = dict(zip((joint.name for joint in self.joints), command.tolist(), strict=True))
        return {link: commands[motor.joint] * motor.ratio for motor in self.motors for link in motor.moves}

    def bodies(self, _mount: Mount, /) -> Mapping[str, Inertia]:
        """Return the inertia by link in the base frame; an entry for the mount's link replaces the link."""
        return {}

    def spheres(self, _tip: Vector, /) -> tuple[ContactSphere, ...]:
        """Return the contact spheres for tissue, given the pose of the tip in the mount's link, (4, 4)."""
        return ()
