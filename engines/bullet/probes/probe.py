"""A probe: proxies in the tissue's world for the spheres of an instrument in another engine."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from engines.bullet.world import COLLISION_MARGIN_M
from engines.tissue.probes.held_patch import HeldPatch, PatchCompliance
from engines.tissue.probes.near_faces import NearFaces
from engines.tissue.probes.params import Coupling, ProbeParams
from engines.tissue.probes.sub_grid import SubGrid
from hub.participant import BondPlan, ForceSide, Inputs
from schemas.errors import SessionError
from schemas.ports import BondSide
from schemas.vectors import Vector

__all__ = ["Probe"]

_LOCKED_INERTIA = 1e3
"""Moment of inertia (kg m^2) against rolling of a sphere by friction, impossible for a part of an instrument.
"""

_PROXY_GROUP, _ALL_BUT_PROXIES = 1 << 6, ~(1 << 6)
"""Collision filter: proxies pass through one another, as neighbours on an instrument overlap.

Bullet's own groups end at 1 << 5.
"""


class Probe:
    """Proxies in Bullet; a virtual coupling pulls each proxy after the predicted motion of a sphere."""

    def __init__(
        self,
        params: ProbeParams,
        coupling: Coupling,
        bond: BondSide,
        plan: BondPlan,
        gravity: float,
        client: int,
    ) -> None:
        """Create the spheres far above everything; the first step moves the spheres to the instrument."""
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
        """Force in Bullet over force of the coupling, to compensate the loss in contacts (see
        `contact_gain`), shape (n,).
        """
        self.corrections = np.ones(n)
        """Measured gains over gains from the geometry of the contact, shape (n,)."""
        self.held = np.zeros(n, dtype=np.bool_)
        """Spheres with anchored tissue, shape (n,); anchors lose nothing of a force: gain 1."""
        self.touching = np.zeros(n, dtype=np.bool_)
        """Spheres touching an organ at the last reading of the contacts, shape (n,)."""
        self._side = ForceSide(bond, plan)
        self.coupling = coupling
        """Coupling of every proxy with the instrument's sphere."""
        self._weight = np.array([0.0, 0.0, coupling.mass * gravity])
        self._spring, self._damper = np.zeros(bond.size), np.zeros(bond.size)
        # (n, 3) each: views of the same numbers
        self._springs, self._dampers = (
            forces[: 3 * n].reshape(n, 3) for forces in (self._spring, self._damper)
        )
        self.targets = self.positions
        """Centres of the spheres on the instrument at the end of the step, as predicted, m, frame `world`,
        shape (n, 3).
        """
        self._applied = np.zeros((n, 3))  # in Bullet, without the weight
        self._dt, self._velocities_before = 1.0, self.velocities  # of and before the last sub-step
        self._reset = np.zeros((n, 3))  # force of the spring when the proxy is at its target
        self._reset_rate = 1.0 / coupling.reset_time if coupling.reset_time else 0.0
        self.sub_grid: SubGrid | None = None
        """Missing compliance of the mesh under a single sphere; the coupling then needs no reset."""
        self.held_patch: HeldPatch | None = None
        """Missing compliance of the mesh at the held nodes."""
        self.near: Sequence[NearFaces] = ()
        """Faces of each organ near the free spheres at the last reading of the contacts."""
        self._placed = False
        self._client = client
        self.bodies: list[int] = [self._create_sphere(radius) for radius in self.radii.tolist()]
        """Bullet's number of every proxy."""
        self._read_velocity, self._apply, self._frame = (
            bullet.getBaseVelocity,
            bullet.applyExternalForce,
            bullet.WORLD_FRAME,
        )

    @property
    def forces(self) -> Vector:
        """Force (N) of the coupling on every proxy, shape (n, 3).

        The force of the last sub-step, or of the end of the last step.
        """
        return self._springs + self._dampers

    @property
    def sight(self) -> float:
        """Distance from a sphere's centre for the search of faces before contact, m."""
        return 0.0 if self.sub_grid is None else self.sub_grid.sight(self.velocities[0])

    @property
    def contacts(self) -> Vector:
        """Contact force (N) of each proxy in the last sub-step, as in Bullet, shape (n, 3)."""
        return self._applied - self.coupling.mass / self._dt * (self.velocities - self._velocities_before)

    def hold(self, spheres: NDArray[np.int64], *, held: bool) -> None:
        """Mark spheres as holding tissue or not; a spring in series goes with what is let go."""
        self.held[spheres] = held
        self.gains[spheres] = 1.0
        if not held:
            self.held_patch = None

    def soften(self, spheres: NDArray[np.int64], patch: PatchCompliance) -> None:
        """Put a spring of the compliance that is missing in series with the pull of these spheres."""
        self.held_patch = HeldPatch(spheres, self.coupling, patch.missing)

    def begin(self, inputs: Inputs, h: float) -> None:
        """Store the motion of the motion side at the start of a step of `h` seconds."""
        self._side.begin(inputs, h)
        if not self._placed:
            self._place()

    def set_stiffness(self, stiffness: float) -> None:
        """Change the stiffness (N/m) of the coupling from this step on."""
        self.coupling.stiffness = stiffness
        self._side.set_stiffness(stiffness)

    def push(self, tau: float, dt: float) -> None:
        """Apply the coupling forces of the sub-step of `dt` seconds around `tau`, evaluated at the middle."""
        self._stretch(tau, 0.5 * dt)
        if self.sub_grid is not None:
            self.sub_grid.give_way(self._springs[0], self._dampers[0], dt, keep=True)
        if self.held_patch is not None:
            self.held_patch.give_way(self._springs, self._dampers, dt, keep=True)
        self._side.add(self._spring, self._damper, tau, dt)
        if self._reset_rate and self.sub_grid is None:
            self._reset += self._reset_rate * dt * (self._springs - self._reset)
        self._applied = self.gains[:, None] * (self._springs + self._dampers)
        apply, frame, client = self._apply, self._frame, self._client
        for body, force, position in zip(
            self.bodies, (self._applied + self._weight).tolist(), self.positions.tolist(), strict=True
        ):
            apply(body, -1, force, position, frame, client)

    def read(self, dt: float) -> None:
        """Read velocities from Bullet after a sub-step of `dt` seconds, and move as Bullet does.

        A multi-body moves by velocity times sub-step, so the positions need not be read.
        """
        read, client = self._read_velocity, self._client
        self._dt, self._velocities_before = dt, self.velocities
        self.velocities = np.array([read(body, client)[0] for body in self.bodies])
        self.positions = self.positions + dt * self.velocities

    def result(self, t: int, h: float) -> dict[str, Vector]:
        """Return force or wrench, and work, at the end `t` (ns) of a step of `h` seconds.

        Raises SessionError for non-finite values.

        A wrench acts at the centre of the sphere, without torque: the sphere does not resist rotation.
        """
        self._stretch(h, 0.0)
        if self.sub_grid is not None:
            self.sub_grid.give_way(self._springs[0], self._dampers[0], 0.5 * self._dt, keep=False)
        if self.held_patch is not None:
            self.held_patch.give_way(self._springs, self._dampers, 0.5 * self._dt, keep=False)
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
        """Positions, velocities, gains, the state of the bond, and of the spring in series."""
        own = self.positions, self.velocities, self.gains, self.corrections, self._reset, self._side.state
        if self.held_patch is not None:
            own = (*own, self.held_patch.yielded)
        return own if self.sub_grid is None else (*own, self.sub_grid.state)

    def remove(self) -> None:
        """Take the proxies out of the world."""
        import pybullet as bullet

        for body in self.bodies:
            bullet.removeBody(body, physicsClientId=self._client)

    def _stretch(self, tau: float, ahead: float) -> None:
        """Set spring and damper `tau` seconds into the step.

        The proxies are predicted `ahead` seconds from now.
        """
        self.targets, velocities = self._motion(tau)
        springs, dampers = self._springs, self._dampers
        np.subtract(self.targets, self.positions, out=springs)
        if ahead:
            springs -= ahead * self.velocities
        springs *= self.coupling.stiffness
        springs += self._reset
        np.subtract(velocities, self.velocities, out=dampers)
        dampers *= self.coupling.damping

    def _motion(self, tau: float) -> tuple[Vector, Vector]:
        """Return positions (m) and velocities (m/s) of the instrument's spheres, shapes (n, 3).

        `tau`: how far into the step, s.
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

    def _create_sphere(self, radius: float) -> int:
        """Create a proxy of `radius` (m); return the number in Bullet."""
        import pybullet as bullet

        client = self._client
        shape = bullet.createCollisionShape(
            bullet.GEOM_SPHERE, radius=radius - COLLISION_MARGIN_M, physicsClientId=client
        )
        # A multi-body: with maximal coordinates the sphere is not finite after its first step (pybullet
        # 3.2.7).
        body = bullet.createMultiBody(
            self.coupling.mass,
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
