"""A probe: the spheres that stand in the tissue's world for those of an instrument that moves in another
engine.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from engines.bullet.contact import COLLISION_MARGIN_M
from engines.bullet.grasp import GraspParams
from hub.participant import BondPlan, ForceSide, Inputs
from schemas.errors import SessionError
from schemas.ports import BondSide
from schemas.quantity import Damping, Length, Mass, Stiffness
from schemas.vectors import Vector

__all__ = ["Coupling", "Probe", "ProbeParams"]

_STIFFNESS_RATIO = 20.0
"""Virtual coupling to contact: a quick press loses 1/21, 5 %, of its way to the coupling; what lasts loses
nothing, see `Coupling.reset_time`.
"""

_STEP_SHARE = 0.5
"""Sub-step times sqrt(k / m): keeps the explicit spring and damper of a proxy well inside stability (explicit
limit with critical damping: 2 (sqrt(2) - 1)).
"""

_RESET_SHARE = 4.0
"""Reset time times sqrt(k / m): slow beside the proxy's own oscillation."""

_PASSIVE_SHARE = 0.5
"""Of the tissue's damping, what the reset may use up: contacts may be twice as stiff as estimated, and a
scheme of finite steps lags too.
"""

_LOCKED_INERTIA = 1e3
"""Moment of inertia (kg m^2) that keeps a sphere from rolling off on friction, which the instrument does not
let it do.
"""

_PROXY_GROUP, _ALL_BUT_PROXIES = 1 << 6, ~(1 << 6)
"""Collision filter: proxies pass through each other, as neighbours on an instrument overlap.

Bullet's own groups end at 1 << 5.
"""

Radius = Annotated[Length, Field(ge=0.5e-3)]


@dataclass(frozen=True)
class Coupling:
    """The spring and damper between each proxy and its sphere on the instrument, and the mass of the proxy."""

    stiffness: float
    """k, N/m."""
    mass: float
    """m, kg."""
    damping: float
    """b, N s/m."""
    reset_time: float | None
    """T, s, of a spring that is proportional and integral: with it, the proxy of an instrument at rest stands
    where its sphere is, whatever the force.

    None: the spring is proportional, and yields by force / k.
    """

    @property
    def longest_step(self) -> float:
        """Longest sub-step (s) of the proxy: 0.5 sqrt(m / k)."""
        return _STEP_SHARE * sqrt(self.mass / self.stiffness)


class ProbeParams(BaseModel):
    """The spheres of an instrument and their virtual coupling. SI units after validation."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    spheres: int | None = Field(
        default=None,
        ge=1,
        le=100,
        description="contact spheres bonded as points; without it the probe is one sphere on a frame",
    )
    radius: Radius | tuple[Radius, ...] = Field(
        default=5e-3, description="one for all spheres, or one for each"
    )
    stiffness: Stiffness | None = Field(
        default=None,
        gt=0,
        description="k of the virtual coupling; default: 20 times that of the stiffest organ at the contact",
    )
    mass: Mass | None = Field(
        default=None,
        gt=0,
        description="m of each proxy; default: the least for which the sub-step is at most 0.5 sqrt(m / k)",
    )
    damping: Damping | None = Field(
        default=None, gt=0, description="b of the virtual coupling; default: critical, 2 sqrt(k m)"
    )
    grasp: GraspParams | None = Field(
        default=None, description="lets the spheres take hold of tissue, as fingers"
    )

    @model_validator(mode="after")
    def _a_radius_for_each(self) -> ProbeParams:
        if isinstance(self.radius, tuple) and len(self.radius) != (self.spheres or 1):
            raise ValueError(
                f"{len(self.radius)} radii for {self.spheres or 1} spheres: state one radius for all, or one"
                " for each"
            )
        return self

    @model_validator(mode="after")
    def _spheres_for_each_finger(self) -> ProbeParams:
        if self.grasp is not None and (self.spheres or 1) % self.grasp.fingers:
            raise ValueError(
                f"{self.spheres or 1} spheres on {self.grasp.fingers} fingers: every finger needs the same"
                " number of them"
            )
        return self

    @property
    def radii(self) -> Vector:
        """Radius (m) of every sphere, shape (n,)."""
        return np.full(self.spheres or 1, self.radius, dtype=np.float64)

    def coupling(self, contact_stiffness: float, contact_damping: float, timestep: float) -> Coupling:
        """Return what is stated, and the rest by rule from the tissue and the sub-step (s).

        contact_stiffness: k_c of the tissue, N/m. contact_damping: its ratio d of damping to stiffness, s. A
        spring with reset gives back more than it took, in cycles of frequency w at most the share w T k_c /
        k; the tissue's damping takes up w d. So there is a reset where T <= 0.5 d k / k_c.
        """
        stiffness = self.stiffness or _STIFFNESS_RATIO * contact_stiffness
        mass = self.mass or stiffness * (timestep / _STEP_SHARE) ** 2
        reset = _RESET_SHARE * sqrt(mass / stiffness)
        passive = reset <= _PASSIVE_SHARE * contact_damping * stiffness / contact_stiffness
        return Coupling(
            stiffness, mass, self.damping or 2.0 * sqrt(stiffness * mass), reset if passive else None
        )


class Probe:
    """Proxies in Bullet, each drawn by a virtual coupling after the predicted motion of its sphere on the
    instrument.
    """

    def __init__(
        self,
        params: ProbeParams,
        coupling: Coupling,
        bond: BondSide,
        plan: BondPlan,
        gravity: float,
        client: int,
    ) -> None:
        """Create the spheres far above everything; the first step puts them where the other side is."""
        import pybullet as bullet

        self.name = bond.name
        self.radii = params.radii
        """m, shape (n,)."""
        n = len(self.radii)
        self.positions = np.full((n, 3), 1e3)
        """Centres, m, frame `world`, shape (n, 3)."""
        self.velocities = np.zeros((n, 3))
        """m/s, frame `world`, shape (n, 3)."""
        self.gains = np.ones(n)
        """How much larger the force in Bullet is than that of the coupling, to make up for what contacts lose
        (see `contact`), shape (n,).
        """
        self.corrections = np.ones(n)
        """How much the measured gains differ from those that the geometry of the contact suggests, shape
        (n,).
        """
        self.held = np.zeros(n, dtype=np.bool_)
        """Which spheres have tissue anchored to them; anchors lose nothing of a force, so their gain is 1.

        Shape (n,).
        """
        self.touching = np.zeros(n, dtype=np.bool_)
        """Which spheres were at an organ when last looked at, shape (n,)."""
        self.contacts = np.zeros((n, 3))
        """Force (N) with which each proxy pressed on what it touched in the last sub-step, as Bullet has it,
        shape (n, 3).
        """
        self._side = ForceSide(bond, plan)
        self._coupling = coupling
        self._weight = np.array([0.0, 0.0, coupling.mass * gravity])
        self._spring, self._damper = np.zeros(bond.size), np.zeros(bond.size)
        # (n, 3), views
        self._springs, self._dampers = (
            forces[: 3 * n].reshape(n, 3) for forces in (self._spring, self._damper)
        )
        self.targets = self.positions
        """Centres of the spheres on the instrument at the end of the step, as predicted, m, frame `world`,
        shape (n, 3).
        """
        self._reset = np.zeros((n, 3))  # force of the spring when the proxy is at its target
        self._reset_rate = 1.0 / coupling.reset_time if coupling.reset_time else 0.0
        self._placed = False
        self._client = client
        self.bodies: list[int] = [self._sphere(radius) for radius in self.radii.tolist()]
        """Bullet's number of every proxy."""
        self._read_pose, self._read_velocity, self._apply, self._frame = (
            bullet.getBasePositionAndOrientation,
            bullet.getBaseVelocity,
            bullet.applyExternalForce,
            bullet.WORLD_FRAME,
        )

    @property
    def forces(self) -> Vector:
        """Force (N) of the coupling on every proxy in the last sub-step, or at the end of the last step,
        shape (n, 3).
        """
        return self._springs + self._dampers

    def begin(self, inputs: Inputs, h: float) -> None:
        """Take the other side's motion at the start of a step of `h` seconds."""
        self._side.begin(inputs, h)
        if not self._placed:
            self._place()

    def push(self, tau: float, dt: float) -> None:
        """Apply the coupling forces of the sub-step of `dt` seconds around `tau`, taken at its middle."""
        self._stretch(tau, 0.5 * dt)
        self._side.add(self._spring, self._damper, tau, dt)
        self._reset += self._reset_rate * dt * (self._springs - self._reset)
        self._applied = self.gains[:, None] * (self._springs + self._dampers)
        for body, force, position in zip(
            self.bodies, (self._applied + self._weight).tolist(), self.positions.tolist(), strict=True
        ):
            self._apply(body, -1, force, position, self._frame, physicsClientId=self._client)

    def read(self, dt: float) -> None:
        """Take positions and velocities from Bullet after a sub-step of `dt` seconds."""
        client, before = self._client, self.velocities
        self.positions = np.array([self._read_pose(body, physicsClientId=client)[0] for body in self.bodies])
        self.velocities = np.array(
            [self._read_velocity(body, physicsClientId=client)[0] for body in self.bodies]
        )
        self.contacts = self._applied - self._coupling.mass / dt * (self.velocities - before)

    def result(self, t: int, h: float) -> dict[str, Vector]:
        """Return force or wrench, and work, at the end `t` (ns) of a step of `h` seconds.

        Raises SessionError if they are not finite.

        A wrench acts at the centre of its sphere: its torque is zero, as the sphere does not resist being
        turned.
        """
        self._stretch(h, 0.0)
        if not np.isfinite(self._spring).all():
            sphere = int(np.flatnonzero(~np.isfinite(self._springs).all(axis=1))[0])
            raise SessionError(
                f"probe '{self.name}', sphere {sphere}, is at {self.positions[sphere]} at {t * 1e-9:.6g} s."
                " The likeliest cause is a contact that became unstable: shorten the timestep, or lower the"
                " probe's stiffness"
            )
        return self._side.result(self._spring, self._damper)

    @property
    def idle(self) -> dict[str, Vector]:
        """Force or wrench, and work, before anything has moved."""
        return {self._side.force_port: np.zeros(len(self._spring)), self._side.work_port: np.zeros(1)}

    @property
    def state(self) -> tuple[Vector, ...]:
        """Positions, velocities, gains and what the bond remembers."""
        return self.positions, self.velocities, self.gains, self.corrections, self._reset, self._side.state

    def _stretch(self, tau: float, ahead: float) -> None:
        """Set spring and damper `tau` seconds into the step, with the proxies where they will be `ahead`
        seconds from now.
        """
        self.targets, velocities = self._motion(tau)
        self._springs[:] = (
            self._coupling.stiffness * (self.targets - self.positions - ahead * self.velocities) + self._reset
        )
        self._dampers[:] = self._coupling.damping * (velocities - self.velocities)

    def _motion(self, tau: float) -> tuple[Vector, Vector]:
        """Return where the spheres of the instrument are (m) and their velocities (m/s), shapes (n, 3), `tau`
        seconds into the step.
        """
        shape = self.positions.shape
        return self._side.position(tau).reshape(shape), self._side.velocity(tau)[
            : self.positions.size
        ].reshape(shape)

    def _place(self) -> None:
        import pybullet as bullet

        positions, velocities = self._motion(0.0)
        self.positions, self.velocities = positions.copy(), velocities.copy()
        for body, position, velocity in zip(
            self.bodies, positions.tolist(), velocities.tolist(), strict=True
        ):
            bullet.resetBasePositionAndOrientation(
                body, position, [0.0, 0.0, 0.0, 1.0], physicsClientId=self._client
            )
            bullet.resetBaseVelocity(body, velocity, [0.0, 0.0, 0.0], physicsClientId=self._client)
        self._placed = True

    def _sphere(self, radius: float) -> int:
        """Create a proxy of `radius` (m); return its number."""
        import pybullet as bullet

        client = self._client
        shape = bullet.createCollisionShape(
            bullet.GEOM_SPHERE, radius=radius - COLLISION_MARGIN_M, physicsClientId=client
        )
        # A multi-body: with maximal coordinates the sphere is not finite after its first step (pybullet
        # 3.2.7).
        body = bullet.createMultiBody(
            self._coupling.mass,
            shape,
            basePosition=self.positions[0].tolist(),
            useMaximalCoordinates=False,
            physicsClientId=client,
        )
        bullet.setCollisionFilterGroupMask(body, -1, _PROXY_GROUP, _ALL_BUT_PROXIES, physicsClientId=client)
        bullet.changeDynamics(
            body,
            -1,
            lateralFriction=1.0,
            linearDamping=0.0,
            angularDamping=0.0,
            localInertiaDiagonal=[_LOCKED_INERTIA] * 3,
            activationState=bullet.ACTIVATION_STATE_DISABLE_SLEEPING,
            physicsClientId=client,
        )
        return int(body)
