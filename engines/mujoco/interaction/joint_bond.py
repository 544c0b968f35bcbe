"""The bond at a joint: a drive in another engine turns or pushes the joint."""

from __future__ import annotations

import mujoco
import numpy as np

from engines.mujoco.interaction.mechanics import effective_mass
from hub.participant import Inputs, MotionSide
from schemas.vectors import Vector

__all__ = ["JointBond", "release"]


def release(spec: mujoco.MjSpec, name: str) -> None:
    """Take servo, friction, springs and rotor from the joint `name`: a drive elsewhere has them."""
    joint, actuator = spec.joint(name), spec.actuator(name)
    joint.damping, joint.frictionloss, joint.armature = [0.0, 0.0, 0.0], 0.0, 0.0
    joint.stiffness, joint.springref = [0.0, 0.0, 0.0], 0.0
    actuator.gear = np.zeros(6)


class JointBond:
    """Views of the model's data for a joint; nothing is allocated in a step."""

    acts_off_centre = False

    def __init__(
        self, name: str, motion: MotionSide, goal: Vector, model: mujoco.MjModel, data: mujoco.MjData
    ) -> None:
        """Let `motion` act on the joint `<arm>/<joint>`; `goal`: view of the setpoint, shape (1,)."""
        self.motion, self.bond = motion, name
        joint = model.joint(name)
        dof, at = int(joint.dofadr[0]), int(joint.qposadr[0])
        self._position, self._velocity = data.qpos[at : at + 1], data.qvel[dof : dof + 1]
        self._force = data.qfrc_applied[dof : dof + 1]
        arm, _, own = name.partition("/")
        effort = int(model.sensor(f"{arm}/effort/{own}").adr[0])
        self._effort = data.sensordata[effort : effort + 1]
        self._last = self._position.copy()
        self.outputs = {**motion.result(self._position, self._velocity), f"{name}/goal": goal}

    def begin(self, inputs: Inputs) -> None:
        """Apply the reaction at the beginning of a step."""
        self.motion.begin(inputs, self._position, self._velocity)
        self._last[:] = self._position
        self._force[:] = self.motion.force(0.0, self._position, self._velocity)

    def renew(self, tau: float) -> None:
        """Follow the bond's correction: a new force from `tau` seconds into the step on."""
        self._record_work()
        self._force[:] = self.motion.force(tau, self._position, self._velocity)

    def end(self) -> None:
        """Record the work done; the force of the drive is the joint's measured effort."""
        self._record_work()
        self.refresh()

    def _record_work(self) -> None:
        self.motion.add(self._force, self._position - self._last)
        self._last[:] = self._position

    def refresh(self) -> None:
        """Report the force of the model's present state."""
        self._effort[:] = self._force

    @staticmethod
    def least_mass(name: str, model: mujoco.MjModel, data: mujoco.MjData) -> float:
        """Return the mass (kg, kg m^2) under a force on the joint, all other joints free."""
        jacobian = np.zeros((1, model.nv))
        jacobian[0, int(model.joint(name).dofadr[0])] = 1.0
        return effective_mass(jacobian, model, data)
