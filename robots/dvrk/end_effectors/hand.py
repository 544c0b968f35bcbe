"""A hand of under-actuated fingers at the end of a shaft: geometry, tendons and kinematics.

Two motors drive the three joints of a finger. One sets the *spread* s (rad), where the spring in the first
joint is at rest. The other winds a tendon up that runs over a pulley in every joint and closes the phalanges
against springs: how far each goes is decided by springs and by what it meets, and a phalanx blocked
lets the others go on. At the tension T of the tendon, joint i with pulley r_i and spring k_i (at rest at
q_i0, s for the first one) stands, unloaded, at q_i = q_i0 + r_i T / k_i, inside its stops.

The *closing* u (rad) of a finger is the length of tendon wound up, over the radius of the first pulley: u =
sum r_i q_i / r_1; the tendon slackens where less is wound up than the springs leave over. At spread 0 and
closing 0 the fingers are straight along the shaft. A *command* of the hand has the closings of all fingers,
then their spreads.

The hand's frame is that of the link that rolls: z along the shaft to the fingertips, origin where the shaft
ends. SI units, radians.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from robots.dvrk.drive import Drive
from robots.dvrk.end_effectors.contact_sphere import ContactSphere
from robots.dvrk.end_effectors.end_effector import EndEffector, Motor, Mount
from robots.dvrk.inertia import Inertia
from robots.dvrk.link import Link, Spring
from robots.limits import TOLERANCE, distinct
from robots.serial_chain import Joint
from schemas.errors import MotionError, did_you_mean
from schemas.plain_sum import plain_sum
from schemas.vectors import Vector

__all__ = ["Hand", "HandLink", "Mode", "Phalanx"]

_CARRIER = "roll"
"""The link under the fingers."""


@dataclass(frozen=True)
class Phalanx:
    """A phalanx with joint, pulley and spring; the same in all fingers.

    Positive angles close.
    """

    name: str
    length: float
    """Distance to the next joint, from the last joint to the centre of the fingertip, m."""
    lower: float
    upper: float
    """Stops, rad."""
    pulley: float
    """Radius of the pulley under the tendon, m."""
    stiffness: float
    """Spring stiffness, N m/rad."""
    rest: float
    """Rest position of the spring, rad; below `lower` the spring presses the joint to the stop.

    For the first phalanx: with the spread at 0.
    """
    contact: float
    """Place of the contact sphere's centre, share of the phalanx's length."""


@dataclass(frozen=True)
class HandLink:
    """A phalanx of a finger, as a body.

    Frame: z along the joint's axis, x along the phalanx, y to the closing side.
    """

    name: str
    parent: str
    pose: Vector
    """Pose in the hand's frame with every joint at 0, shape (4, 4)."""
    phalanx: Phalanx


@dataclass(frozen=True)
class Mode:
    """An actuation pattern: commands (rad) of the open and of the closed hand.

    A number from 0 (open) to 1 (closed) interpolates.
    """

    open: tuple[float, ...]
    closed: tuple[float, ...]


@dataclass(frozen=True)
class Hand(EndEffector):
    """Fingers about a shaft."""

    palm: float
    """Distance of the first joints from the end of the shaft, m."""
    offset: float
    """Distance of the first joints from the axis of the shaft, m."""
    radius: float
    """Radius of the phalanges and of their contact spheres, m."""
    azimuths: tuple[float, ...]
    """Where each finger stands about the axis, from x towards y, rad."""
    phalanges: tuple[Phalanx, ...]
    """Phalanges of each finger, from the palm outwards."""
    density: float
    """Density of the phalanges, round bars, kg/m^3."""
    effort: float
    """Largest torque of a motor, N m; for a tendon at the first pulley: a tendon pulls, and pushes nothing.
    """
    velocity: float
    """Largest velocity of a closing or spread, rad/s."""
    acceleration: float
    jerk: float
    modes: Mapping[str, Mode]

    name: ClassVar[str] = "hand"
    goal: ClassVar[str] = "goal of closings and spreads"
    measured: ClassVar[str] = (
        "closings of the fingers and positions of their first joints, and the torques of the motors"
    )

    @property
    def fingers(self) -> tuple[str, ...]:
        """Names of the fingers, `finger1` and so on; also of their tendons and closings."""
        return tuple(f"finger{i}" for i in range(1, len(self.azimuths) + 1))

    @property
    def spreads(self) -> tuple[str, ...]:
        """Names of the spreads."""
        return tuple(f"spread{i}" for i in range(1, len(self.azimuths) + 1))

    @cached_property
    def bones(self) -> tuple[HandLink, ...]:
        """The bodies of all phalanges, finger by finger, from the palm outwards."""
        bones: list[HandLink] = []
        for finger, azimuth in zip(self.fingers, self.azimuths, strict=True):
            c, s = np.cos(azimuth), np.sin(azimuth)
            pose, parent = np.eye(4), _CARRIER
            pose[:3, 0], pose[:3, 1], pose[:3, 2] = (0.0, 0.0, 1.0), (-c, -s, 0.0), (s, -c, 0.0)
            pose[:3, 3] = self.offset * c, self.offset * s, self.palm
            for phalanx in self.phalanges:
                bones.append(HandLink(f"{finger}_{phalanx.name}", parent, pose, phalanx))
                pose, parent = pose.copy(), bones[-1].name
                pose[2, 3] += phalanx.length
        return tuple(bones)

    @property
    def joints(self) -> tuple[Joint, ...]:
        """Closings and spreads as joints, with ranges and limits."""
        first, ratios = self.phalanges[0], self._pulley_radii / self._pulley_radii[0]
        limits = (self.velocity, self.effort, self.acceleration, self.jerk)
        most = float(ratios @ [phalanx.upper for phalanx in self.phalanges])
        ranges = [(name, first.lower, most) for name in self.fingers] + [
            (name, first.lower, first.upper) for name in self.spreads
        ]
        return tuple(
            Joint(name, "revolute", 0.0, 0.0, 0.0, 0.0, lower, upper, *limits)
            for name, lower, upper in ranges
        )

    @property
    def motors(self) -> tuple[Motor, ...]:
        """Finger by finger, the tendon that closes it, and the spread.

        A closing is turned by a disc with a tendon; the friction stays with the motor, as opening springs do
        not turn the disc. A spread moves the end of a spring, with the friction of the first joints.
        """
        spring, friction = self.phalanges[0].stiffness, float(self.damping[0])
        closing = Drive.of_disc(1.0, self.effort, self.velocity)
        spreading = Drive(spring, friction, 0.0, 0.0, 0.0, 0.0, 0.0, self.effort, self.velocity)
        motors: list[Motor] = []
        for finger, spread in zip(self.fingers, self.spreads, strict=True):
            bones = [f"{finger}_{phalanx.name}" for phalanx in self.phalanges]
            ratios = [phalanx.pulley / self.phalanges[0].pulley for phalanx in self.phalanges]
            moves = dict(zip(bones, ratios, strict=True))
            motors.append(Motor(finger, finger, "tendon", closing, moves))
            motors.append(Motor(spread, spread, "spring", spreading, {bones[0]: 1.0}))
        return tuple(motors)

    def links(self, mount: Mount, /) -> tuple[Link, ...]:
        """Return the phalanges; the spread is the spring in the first joint of a finger."""
        first, damping = self.phalanges[0], dict(zip(self.phalanges, self.damping.tolist(), strict=True))
        return tuple(
            Link(
                bone.name,
                bone.parent,
                "revolute",
                mount.pose @ bone.pose,
                bone.phalanx.lower,
                bone.phalanx.upper,
                spring=None
                if bone.phalanx is first
                else Spring(bone.phalanx.stiffness, bone.phalanx.rest, damping[bone.phalanx]),
                reading="phalanges",
            )
            for bone in self.bones
        )

    def positions(self, command: Vector) -> Mapping[str, float]:
        """Return the positions of the phalanges at rest, free of contact."""
        return dict(
            zip(
                (bone.name for bone in self.bones),
                self.unloaded_positions(command).ravel().tolist(),
                strict=True,
            )
        )

    def bodies(self, mount: Mount, /) -> Mapping[str, Inertia]:
        """Return the phalanges, straight."""
        bodies: dict[str, Inertia] = {}
        for bone, mass in zip(self.bones, np.tile(self.masses, len(self.fingers)).tolist(), strict=True):
            start, along = (mount.pose @ bone.pose)[:3, 3], (mount.pose @ bone.pose)[:3, 0]
            bodies[bone.name] = Inertia.of_rod(mass, start, start + bone.phalanx.length * along, self.radius)
        return bodies

    def spheres(self, _tip: Vector, /) -> tuple[ContactSphere, ...]:
        """Return a contact sphere on each phalanx, in the order of `bones`."""
        return tuple(
            ContactSphere(
                bone.name, bone.name, (bone.phalanx.contact * bone.phalanx.length, 0.0, 0.0), self.radius
            )
            for bone in self.bones
        )

    @property
    def reach(self) -> float:
        """Distance of the end of the straight fingers from the end of the shaft, m."""
        return self.palm + plain_sum(phalanx.length for phalanx in self.phalanges) + self.radius

    @cached_property
    def masses(self) -> Vector:
        """Masses of the phalanges of a finger, kg, shape (phalanges,)."""
        return np.array(
            [self.density * np.pi * self.radius**2 * phalanx.length for phalanx in self.phalanges]
        )

    @cached_property
    def damping(self) -> Vector:
        """Viscous friction of the joints of a finger, N m s/rad, shape (phalanges,).

        Critical damping of a spring with everything beyond the joint, straight: 2 sqrt(k I), I = sum m (l^2 /
        12 + d^2).
        """
        lengths = np.array([phalanx.length for phalanx in self.phalanges])
        starts = np.cumsum(lengths) - lengths
        away = np.maximum((starts + lengths / 2.0) - starts[:, None], 0.0)  # (joint, phalanx)
        inertia = (
            np.triu(np.ones((len(lengths), len(lengths)))) * self.masses * (lengths**2 / 12.0 + away**2)
        ).sum(axis=1)
        return 2.0 * np.sqrt(np.array([phalanx.stiffness for phalanx in self.phalanges]) * inertia)

    def command(self, mode: str, closing: float) -> Vector:
        """Return the command (rad), shape (2 fingers,), of a mode closed by `closing`, 0 to 1.

        Raises MotionError.
        """
        pattern = self.modes.get(mode)
        if pattern is None:
            raise MotionError(f"no mode '{mode}'.{did_you_mean(mode, self.modes)}")
        if not -TOLERANCE <= closing <= 1.0 + TOLERANCE:
            value = distinct(closing, 0.0, 1.0)[0]
            raise MotionError(f"closing {value} of mode '{mode}', allowed are 0 (open) to 1 (closed)")
        closing = min(max(closing, 0.0), 1.0)
        start, end = np.array(pattern.open), np.array(pattern.closed)
        return start + closing * (end - start)

    def unloaded_positions(self, command: Vector) -> Vector:
        """Return the joint positions (rad), shape (fingers, phalanges), of fingers that touch nothing.

        The command has shape (2 fingers,).
        """
        closings, spreads = command.reshape(2, -1).tolist()
        return np.array(
            [self._positions(self.tension(u, s), s) for u, s in zip(closings, spreads, strict=True)]
        )

    def tension(self, closing: float, spread: float) -> float:
        """Return the tension (N) of the tendon of a finger that touches nothing; 0 where it is slack."""
        stops = [
            p.stiffness * (stop - rest) / p.pulley
            for p, rest in zip(self.phalanges, self._rest(spread), strict=True)
            for stop in (p.lower, p.upper)
        ]
        # between these all moves in proportion
        tensions = sorted({0.0, *(stop for stop in stops if stop > 0.0)})
        closings = [
            float(self._positions(tension, spread) @ self._pulley_radii) / float(self._pulley_radii[0])
            for tension in tensions
        ]
        return float(np.interp(closing, closings, tensions))

    def contacts(self, positions: Vector) -> Vector:
        """Return the centres of the contact spheres in the hand's frame (m).

        They have shape (..., fingers, phalanges, 3).

        Args:
            positions: of the joints, rad, shape (..., fingers, phalanges).
        """
        angles = np.cumsum(positions, axis=-1)
        lengths = np.array([phalanx.length for phalanx in self.phalanges])
        shares = np.array([phalanx.contact for phalanx in self.phalanges])
        # along the shaft and towards its axis, (..., 2)
        ways = np.stack([np.cos(angles), np.sin(angles)], axis=-1) * lengths[:, None]
        along, inwards = np.moveaxis(np.cumsum(ways, axis=-2) - (1.0 - shares)[:, None] * ways, -1, 0)
        radial = self.offset - inwards
        azimuths = np.array(self.azimuths)[:, None]
        return np.stack([radial * np.cos(azimuths), radial * np.sin(azimuths), self.palm + along], axis=-1)

    @cached_property
    def _pulley_radii(self) -> Vector:
        return np.array([phalanx.pulley for phalanx in self.phalanges])

    def _rest(self, spread: float) -> list[float]:
        first, *others = self.phalanges
        return [first.rest + spread, *(phalanx.rest for phalanx in others)]

    def _positions(self, tension: float, spread: float) -> Vector:
        """Return the unloaded joint positions of a finger, shape (phalanges,).

        It is at a tension (N) and a spread (rad).
        """
        slope, lower, upper = np.array([(p.pulley / p.stiffness, p.lower, p.upper) for p in self.phalanges]).T
        return np.clip(self._rest(spread) + slope * tension, lower, upper)
