"""A probe: the sphere that stands in the tissue's world for an instrument that moves in another engine."""

from __future__ import annotations

from math import sqrt

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from hub.bond import ForceSide
from hub.inputs import Inputs
from hub.participant import BondPlan
from schemas.errors import SessionError
from schemas.ports import BondSide
from schemas.quantity import Length, Mass, Stiffness
from schemas.vectors import Vector

__all__ = ["ProbeParams", "Proxy"]

_LOCKED_INERTIA = 1e3
"""Moment of inertia (kg m^2) that keeps the sphere from rolling off on friction, which the instrument does not let it do."""


class ProbeParams(BaseModel):
    """A spherical probe and its virtual coupling, a spring and a critical damper. SI units after validation."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    radius: Length = Field(default=5e-3, gt=0)
    mass: Mass = Field(default=20e-3, gt=0, description="of the proxy; not felt by the other side beyond the coupling")
    stiffness: Stiffness = Field(default=1000.0, gt=0, description="of the virtual coupling")

    @property
    def damping(self) -> float:
        """Damping of the virtual coupling, N s/m: 2 sqrt(k m), critical."""
        return 2.0 * sqrt(self.stiffness * self.mass)

    @property
    def longest_step(self) -> float:
        """Longest sub-step (s) of the proxy: 0.5 sqrt(m / k) keeps the explicit spring and damper well inside stability."""
        return 0.5 * sqrt(self.mass / self.stiffness)


class Proxy:
    """The sphere in Bullet, drawn by the virtual coupling after the predicted motion of the other side."""

    def __init__(self, params: ProbeParams, bond: BondSide, plan: BondPlan, gravity: float, client: int) -> None:
        """Create the sphere far above everything; the first step puts it where the other side is."""
        import pybullet as bullet

        self.name = bond.name
        self.position = np.array([0.0, 0.0, 1e3])
        """Centre, m, frame `world`, shape (3,)."""
        self.velocity = np.zeros(3)
        """m/s, frame `world`, shape (3,)."""
        self.radius = params.radius
        self.gain = 1.0
        """How much larger the force in Bullet is than that of the coupling, to make up for what contacts lose (see `contact`)."""
        self._side = ForceSide(bond, plan)
        self._stiffness, self._damping = params.stiffness, params.damping
        self._weight = np.array([0.0, 0.0, params.mass * gravity])
        self._spring, self._damper = np.zeros(bond.dof), np.zeros(bond.dof)
        self._placed = False
        self._client = client
        shape = bullet.createCollisionShape(bullet.GEOM_SPHERE, radius=params.radius, physicsClientId=client)
        # A multi-body: with maximal coordinates the sphere is not finite after its first step (pybullet 3.2.7).
        self._body = bullet.createMultiBody(params.mass, shape, basePosition=self.position.tolist(), useMaximalCoordinates=False, physicsClientId=client)
        bullet.changeDynamics(
            self._body,
            -1,
            lateralFriction=1.0,
            linearDamping=0.0,
            angularDamping=0.0,
            localInertiaDiagonal=[_LOCKED_INERTIA] * 3,
            activationState=bullet.ACTIVATION_STATE_DISABLE_SLEEPING,
            physicsClientId=client,
        )
        self._read_pose, self._read_velocity, self._apply, self._frame = (
            bullet.getBasePositionAndOrientation,
            bullet.getBaseVelocity,
            bullet.applyExternalForce,
            bullet.WORLD_FRAME,
        )

    def begin(self, inputs: Inputs, h: float) -> None:
        """Take the other side's motion at the start of a step of `h` seconds."""
        self._side.begin(inputs, h)
        if not self._placed:
            self._place()

    def push(self, tau: float, dt: float) -> None:
        """Apply the coupling force of the sub-step of `dt` seconds around `tau`, taken at its middle."""
        self._spring[:3] = self._stiffness * (self._side.position(tau) - self.position - 0.5 * dt * self.velocity)
        self._damper[:3] = self._damping * (self._side.velocity(tau)[:3] - self.velocity)
        self._side.add(self._spring, self._damper, tau, dt)
        force = self.gain * (self._spring[:3] + self._damper[:3]) + self._weight
        self._apply(self._body, -1, force.tolist(), self.position.tolist(), self._frame, physicsClientId=self._client)

    def read(self) -> None:
        """Take position and velocity from Bullet after a sub-step."""
        self.position = np.array(self._read_pose(self._body, physicsClientId=self._client)[0])
        self.velocity = np.array(self._read_velocity(self._body, physicsClientId=self._client)[0])

    def result(self, t: int, h: float) -> dict[str, Vector]:
        """Return wrench and work at the end `t` (ns) of a step of `h` seconds. Raises SessionError if they are not finite.

        The wrench acts at the centre of the sphere: its torque is zero, as the sphere does not resist being turned.
        """
        self._spring[:3] = self._stiffness * (self._side.position(h) - self.position)
        if not np.isfinite(self._spring).all():
            raise SessionError(
                f"probe '{self.name}' is at {self.position} at {t * 1e-9:.6g} s. The likeliest cause is a contact that became unstable: "
                f"shorten the timestep, or lower the probe's stiffness"
            )
        self._damper[:3] = self._damping * (self._side.velocity(h)[:3] - self.velocity)
        return self._side.result(self._spring, self._damper)

    @property
    def idle(self) -> dict[str, Vector]:
        """Wrench and work before anything has moved."""
        return {self._side.force_port: np.zeros(6), self._side.work_port: np.zeros(1)}

    @property
    def state(self) -> tuple[Vector, Vector, Vector]:
        """Position, velocity and what the bond remembers."""
        return self.position, self.velocity, self._side.state

    def _place(self) -> None:
        import pybullet as bullet

        self.position, self.velocity = self._side.position(0.0).copy(), self._side.velocity(0.0)[:3].copy()
        bullet.resetBasePositionAndOrientation(self._body, self.position.tolist(), [0.0, 0.0, 0.0, 1.0], physicsClientId=self._client)
        bullet.resetBaseVelocity(self._body, self.velocity.tolist(), [0.0, 0.0, 0.0], physicsClientId=self._client)
        self._placed = True
