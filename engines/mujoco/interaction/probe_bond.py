"""The bond at a palpation probe inside the running model."""

from __future__ import annotations

import mujoco
import numpy as np

from engines.mujoco.interaction.mechanics import effective_mass
from engines.mujoco.model import probe_body
from engines.mujoco.model.poses import ROS_ORDER
from hub.participant import Inputs, MotionSide
from schemas.vectors import Vector

__all__ = ["ProbeBond"]

_W_FIRST = [6, 3, 4, 5]
"""MuJoCo's quaternion in a ROS pose."""


class ProbeBond:
    """Views of the model's data for a probe; nothing is allocated in a step."""

    acts_off_centre = False
    """A constant wrench is not renewed within a step: the point of action is the link's centre of mass."""

    def __init__(self, arm: str, motion: MotionSide, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Let `motion` act on the probe of `arm`."""
        self.motion, self.bond = motion, f"{arm}/probe"
        # at the body's centre of mass, which is the probe's centre; (6,)
        self._wrench = data.xfrc_applied[model.body(probe_body(arm)).id]
        self._torque = self._wrench[3:].data
        sensor = int(model.sensor(f"{arm}/tip/position").adr[0])
        self._sensors, self._twist = (
            data.sensordata[sensor : sensor + 7],
            data.sensordata[sensor + 7 : sensor + 13],
        )
        self._position, self._quaternion = self._sensors[:3], self._sensors[3:]
        self._pose = np.empty(7)
        self._moved, self._turned = np.zeros(6), np.empty(3)
        self._translation, self._rotation = self._moved[:3], self._moved[3:]
        to_base = data.site_xmat[model.site(f"{arm}/base").id].reshape(3, 3).T
        self._to_base: Vector = np.kron(np.eye(2), to_base)
        self.tip_wrench = np.zeros(6)
        self.outputs = {**motion.result(self._pose, self._twist), f"{arm}/tip_wrench": self.tip_wrench}
        self.refresh()

    def begin(self, inputs: Inputs) -> None:
        """Apply the reaction at the beginning of a step."""
        self.motion.begin(inputs, self._pose, self._twist)
        self._wrench[:] = self.motion.force(0.0, self._pose, self._twist)

    def renew(self, tau: float) -> None:
        """Follow the bond's correction: a new wrench from `tau` seconds into the step on."""
        self._record_work()
        self._wrench[:] = self.motion.force(tau, self._pose, self._twist)

    def end(self) -> None:
        """Record the work done, and set the wrench at the tip, the probe's centre."""
        self._record_work()
        self._to_base.dot(self._wrench, self.tip_wrench)

    def _record_work(self) -> None:
        """Record the work of the wrench since the last call, and update the pose."""
        np.subtract(self._position, self._pose[:3], out=self._translation)  # the pose is still the one before
        if any(self._torque):  # a sphere in contact feels none
            # in the probe's own axes
            mujoco.mju_subQuat(self._turned, self._quaternion, self._pose[_W_FIRST])
            mujoco.mju_rotVecQuat(self._rotation, self._turned, self._quaternion)
        self.motion.add(self._wrench, self._moved)
        self.refresh()

    def refresh(self) -> None:
        """Update the pose to the model's present state."""
        self._sensors.take(ROS_ORDER, None, self._pose, "clip")  # three times as fast as the default mode

    @staticmethod
    def least_mass(arm: str, model: mujoco.MjModel, data: mujoco.MjData) -> float:
        """Return the least mass (kg) under a force on the probe of `arm` in any direction."""
        jacobian = np.zeros((3, model.nv))
        mujoco.mj_jacBody(model, data, jacobian, None, model.body(probe_body(arm)).id)
        return effective_mass(jacobian, model, data)
