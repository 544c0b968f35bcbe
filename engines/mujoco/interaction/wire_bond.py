"""The bond at a needle: three points of the wire, pushed by another engine.

A needle weighs a tenth of a gram. Where a jaw lets go of it in tissue, nothing but the tissue holds it, and
its force, which is a step old, would throw it about. What tissue also has is viscosity: it acts here, in
MuJoCo's implicit step, for as long as a force comes through the bond (docs/decisions/0062).
"""

from __future__ import annotations

import mujoco
import numpy as np

from engines.mujoco.object_params import NeedleParams
from engines.mujoco.ports import WIRE
from hub.participant import Inputs, MotionSide
from robots.training.needles import NeedleShape
from robots.vector3 import cross
from schemas.vectors import Vector

__all__ = ["WireBond"]


class WireBond:
    """Views of the model's data for a needle."""

    acts_off_centre = False
    """Its moment is not renewed within a step: at 25 degrees a second that changes it by 1e-3 of itself."""

    def __init__(
        self,
        thing: str,
        params: NeedleParams,
        motion: MotionSide,
        model: mujoco.MjModel,
        data: mujoco.MjData,
    ) -> None:
        """Let `motion` act on the needle `thing`."""
        self.thing, self.motion, self.bond = thing, motion, f"{thing}/{WIRE}"
        body = model.body(thing).id
        self._marks = _marks(params)
        self._dofs = slice(first := int(model.joint(thing).dofadr[0]), first + 6)
        self._speed, self._damping = data.qvel[self._dofs], model.dof_damping[self._dofs]
        self._needle_drag = _needle_drag(params)
        self._place, self._axes = data.xpos[body], data.xmat[body].reshape(3, 3)
        self._centre, self._load = data.xipos[body], data.xfrc_applied[body]
        self._position, self._velocity, self._last = np.zeros(9), np.zeros(9), np.zeros(9)
        self._force = np.zeros(9)
        self.wrench = np.zeros(6)
        """Mean force (N) through the bond in the last step and moment (N m) about the world's origin."""
        self.outputs = motion.result(self._position, self._velocity)
        self.refresh()

    def begin(self, inputs: Inputs) -> None:
        """Apply the reaction at the beginning of a step, and the drag, if any."""
        self.motion.begin(inputs, self._position, self._velocity)
        self._push(0.0)
        is_pushed = bool(self._force.any())
        self._is_free = self.motion.is_even and not is_pushed
        self._damping[:] = self._needle_drag if is_pushed else 0.0
        self.wrench[:] = 0.0
        self._substeps = 0

    def renew(self, tau: float) -> None:
        """Record the work done, and renew the load `tau` seconds into the step."""
        if not self._is_free:
            self._move()
            self._push(tau)

    def end(self) -> None:
        """Record the work done, and set the mean wrench."""
        if self._is_free:
            self.refresh()
            return
        self._move()
        self.wrench /= self._substeps

    def refresh(self) -> None:
        """Count work from the points of the model's present state."""
        arms = self._marks @ self._axes.T
        self._position.reshape(3, 3)[:] = self._place + arms
        spin = self._axes @ self._speed[3:]
        self._velocity.reshape(3, 3)[:] = self._speed[:3] + cross(spin, arms)
        self._last[:] = self._position

    @staticmethod
    def least_mass(thing: str, params: NeedleParams, model: mujoco.MjModel, data: mujoco.MjData) -> float:
        """Return the least mass (kg) under forces on the points in a sub-step, drag included."""
        first, arms = int(model.joint(thing).dofadr[0]), _marks(params)
        inertia = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, inertia)
        inertia = inertia[first : first + 6, first : first + 6] + model.opt.timestep * np.diag(
            _needle_drag(params)
        )
        turning = np.zeros((3, 3, 3))  # velocity of each point by the three turns, axes of the needle
        for point, (x, y, z) in zip(turning, arms.tolist(), strict=True):
            point[:] = [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]
        axes = data.xmat[model.body(thing).id].reshape(3, 3)
        jacobian = np.concatenate([np.tile(np.eye(3), (3, 1, 1)), axes @ turning], axis=2).reshape(9, 6)
        return float(1.0 / np.linalg.eigvalsh(jacobian @ np.linalg.solve(inertia, jacobian.T))[-1])

    def _push(self, tau: float) -> None:
        self._force = self.motion.force(tau, self._position, self._velocity)
        forces, points = self._force.reshape(3, 3), self._position.reshape(3, 3)
        self._load[:3] = forces.sum(axis=0)
        self._load[3:] = cross(points - self._centre, forces).sum(axis=0)

    def _move(self) -> None:
        """Record the work and the wrench of a sub-step."""
        self.wrench[:3] += self._load[:3]
        self.wrench[3:] += self._load[3:] + cross(self._centre, self._load[:3])
        self._substeps += 1
        before = self._last.copy()
        self.refresh()
        self.motion.add(self._force, self._position - before)


def _marks(params: NeedleParams) -> Vector:
    """Return the bonded points in the needle's frame, m, shape (3, 3)."""
    return NeedleShape(params.radius, params.arc, params.wire_radius).bond_points


def _needle_drag(params: NeedleParams) -> Vector:
    """Return the damping of the needle's six degrees of freedom, N s/m and N m s/rad."""
    return params.drag * np.repeat([1.0, params.radius**2], 3)
