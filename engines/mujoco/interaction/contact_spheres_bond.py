"""The bond at the contact spheres of an instrument inside the running model."""

from __future__ import annotations

import mujoco
import numpy as np

from engines.mujoco.interaction.mechanics import effective_mass
from engines.mujoco.model import CONTACT
from hub.participant import Inputs, MotionSide
from schemas.vectors import Vector

__all__ = ["ContactSpheresBond"]

_TURNED = np.array([[1, 2, 0], [2, 0, 1]])
"""Axes y, z, x and z, x, y: a cross product is a(yzx) b(zxy) - a(zxy) b(yzx)."""


class ContactSpheresBond:
    """Views of the model's data for the spheres of an instrument.

    A force stays with the sphere's centre; the centre moves against the link's centre of mass.
    """

    acts_off_centre = True
    """The moment is renewed in every sub-step."""

    def __init__(self, owner: str, motion: MotionSide, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Let `motion` act on the spheres of the instrument of `owner`: an arm, or a spare of an arm."""
        self.motion, self.bond = motion, f"{owner}/{CONTACT}"
        arm, sites = owner.partition("/")[0], _sphere_sites(owner, model)
        n, carriers = len(sites), model.site_bodyid[sites]
        first = int(model.sensor(f"{model.site(sites[0]).name}/position").adr[0])
        self._position, self._velocity = (
            data.sensordata[first : first + 3 * n],
            data.sensordata[first + 3 * n : first + 6 * n],
        )
        self._bodies = np.unique(carriers)
        self._share = (carriers == self._bodies[:, None]).astype(np.float64)  # (bodies, n)
        self._applied, self._masses = data.xfrc_applied, data.xipos.reshape(-1)
        # (2, n, 3): where the axes in the orders of `_TURNED` stand, of each sphere in `_position`, of its
        # force, and of the centre of mass of its link in `_masses`
        self._of_sphere = 3 * np.arange(n)[:, None] + _TURNED[:, None]
        self._of_force = self._of_sphere[::-1].copy()
        self._of_mass = 3 * carriers[:, None] + _TURNED[:, None]
        # arms and forces with their axes in the orders whose products are the two terms of a moment
        self._arms, self._turned, self._terms = np.zeros((3, 2, n, 3))
        self._moved = np.zeros(3 * n)
        # force, and its moment about the centre of mass of the link that carries the sphere
        self._loads = np.zeros((n, 6))
        self._forces, self._moments = self._loads[:, :3], self._loads[:, 3:]
        self._force = np.zeros(3 * n)
        self._last = self._position.copy()
        tip, base = int(model.sensor(f"{arm}/tip/position").adr[0]), model.site(f"{arm}/base").id
        self._tip, self._to_base = data.sensordata[tip : tip + 3], data.site_xmat[base].reshape(3, 3).T.copy()
        self.tip_wrench, self._about_tip = np.zeros(6), np.zeros((n, 3))
        self._tip_force, self._tip_torque = self.tip_wrench[:3], self.tip_wrench[3:]
        self.outputs = {
            **motion.result(self._position, self._velocity),
            f"{arm}/tip_wrench": self.tip_wrench,
        }

    def begin(self, inputs: Inputs) -> None:
        """Apply the reaction at the beginning of a step."""
        self.motion.begin(inputs, self._position, self._velocity)
        self._push(0.0)

    def renew(self, tau: float) -> None:
        """Record the work done, and renew the forces `tau` seconds into the step."""
        self._record_work()
        self._push(tau)

    def end(self) -> None:
        """Record the work done, and set the wrench at the tip."""
        self._record_work()
        self._update_tip_wrench()

    def refresh(self) -> None:
        """Count work from the positions of the model's present state."""
        self._last[:] = self._position

    @staticmethod
    def least_mass(arm: str, model: mujoco.MjModel, data: mujoco.MjData) -> float:
        """Return the least mass (kg) under forces on the spheres of `arm`, in any directions."""
        sites = _sphere_sites(arm, model)
        jacobian = np.zeros((len(sites), 3, model.nv))
        for rows, site in zip(jacobian, sites, strict=True):
            mujoco.mj_jacSite(model, data, rows, None, site)
        return effective_mass(jacobian.reshape(-1, model.nv), model, data)

    def _push(self, tau: float) -> None:
        self._force = self.motion.force(tau, self._position, self._velocity)
        self._forces[:] = self._force.reshape(-1, 3)
        # three times as fast as the default mode
        self._force.take(self._of_force, None, self._turned, "clip")
        self._position.take(self._of_sphere, None, self._arms, "clip")
        self._masses.take(self._of_mass, None, self._terms, "clip")
        np.subtract(self._arms, self._terms, out=self._arms)
        self._set_moments(self._moments)
        self._applied[self._bodies] = self._share @ self._loads

    def _set_moments(self, moments: Vector) -> None:
        """Set `moments` (N m), shape (n, 3), to the moments of the forces at `_arms`."""
        first, second = np.multiply(self._arms, self._turned, out=self._terms)
        np.subtract(first, second, out=moments)

    def _record_work(self) -> None:
        self.motion.add(self._force, np.subtract(self._position, self._last, out=self._moved))
        self._last[:] = self._position

    def _update_tip_wrench(self) -> None:
        self._position.take(self._of_sphere, None, self._arms, "clip")
        self._arms -= self._tip.take(_TURNED)[:, None]
        self._set_moments(self._about_tip)
        self._to_base.dot(np.add.reduce(self._forces, 0), self._tip_force)
        self._to_base.dot(np.add.reduce(self._about_tip, 0), self._tip_torque)


def _sphere_sites(arm: str, model: mujoco.MjModel) -> list[int]:
    """Return the sites of the spheres in the order of their sensors, the order of the instrument's list."""
    sensors = [model.sensor(i) for i in range(model.nsensor)]
    return [
        int(sensor.objid[0])
        for sensor in sensors
        if sensor.name.startswith(f"{arm}/{CONTACT}/") and sensor.name.endswith("/position")
    ]
