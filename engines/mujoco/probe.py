"""The bond at a palpation probe inside the running model."""

from __future__ import annotations

import mujoco
import numpy as np

from engines.mujoco.model import probe_body
from hub.bond import MotionSide
from hub.inputs import Inputs
from schemas.vectors import Vector

__all__ = ["Probe", "effective_mass"]

_POSE = np.array([0, 1, 2, 4, 5, 6, 3])
"""Where a pose (x, y, z, qx, qy, qz, qw) stands among MuJoCo's sensors, with quaternions w first."""
_W_FIRST = [6, 3, 4, 5]
"""MuJoCo's quaternion in a ROS pose."""


class Probe:
    """Views of the model's data that belong to one probe; nothing is allocated in a step."""

    def __init__(self, arm: str, motion: MotionSide, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Let `motion` act on the probe of `arm`."""
        self.motion, self.bond = motion, f"{arm}/probe"
        self._wrench = data.xfrc_applied[model.body(probe_body(arm)).id]  # at the body's centre of mass, which is the probe's centre; (6,)
        self._torque = self._wrench[3:].data
        sensor = int(model.sensor(f"{arm}/tip/position").adr[0])
        self._sensors, self._twist = data.sensordata[sensor : sensor + 7], data.sensordata[sensor + 7 : sensor + 13]
        self._position, self._quaternion = self._sensors[:3], self._sensors[3:]
        self._pose = np.empty(7)
        self._moved, self._turned = np.zeros(6), np.empty(3)
        self._translation, self._rotation = self._moved[:3], self._moved[3:]
        self.outputs = motion.result(self._pose, self._twist)
        self.refresh()

    def begin(self, inputs: Inputs) -> None:
        """Take the reaction for the step that begins."""
        self.motion.begin(inputs, self._pose, self._twist)
        self._wrench[:] = self.motion.force(0.0, self._pose, self._twist)

    def correct(self, tau: float) -> None:
        """Follow the bond's correction: a new wrench from `tau` seconds into the step on."""
        self.end()
        self._wrench[:] = self.motion.force(tau, self._pose, self._twist)

    def end(self) -> None:
        """Book the work of the wrench since it was set, and bring the pose up to the model's present state."""
        np.subtract(self._position, self._pose[:3], out=self._translation)  # the pose is still the one before
        if any(self._torque):  # a sphere in contact feels none
            mujoco.mju_subQuat(self._turned, self._quaternion, self._pose[_W_FIRST])  # in the probe's own axes
            mujoco.mju_rotVecQuat(self._rotation, self._turned, self._quaternion)
        self.motion.add(self._wrench, self._moved)
        self.refresh()

    def refresh(self) -> None:
        """Bring the pose up to the model's present state."""
        self._sensors.take(_POSE, None, self._pose, "clip")  # three times as fast as the default mode


def effective_mass(arm: str, model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Return the least mass (kg) that a force on the probe of `arm` meets in any direction: 1 / max eig(J M^-1 J^T).

    The joints of the linkage go with those they follow: J and M are those of the independent joints.
    """
    jacobian, inertia = np.zeros((3, model.nv)), np.zeros((model.nv, model.nv))
    mujoco.mj_jacBody(model, data, jacobian, None, model.body(probe_body(arm)).id)
    mujoco.mj_fullM(model, data, inertia)
    ties = _followers(model)
    jacobian, inertia = jacobian @ ties, ties.T @ inertia @ ties
    return float(1.0 / np.linalg.eigvalsh(jacobian @ np.linalg.solve(inertia, jacobian.T))[-1])


def _followers(model: mujoco.MjModel) -> Vector:
    """Return T, shape (nv, independent), with dq = T dq_independent: the joint equalities of the model as ratios of velocities."""
    ties, led = np.eye(model.nv), list[int]()
    for i in range(model.neq):
        if model.eq_type[i] == mujoco.mjtEq.mjEQ_JOINT and model.eq_active0[i]:
            follower, leader = model.jnt_dofadr[model.eq_obj1id[i]], model.jnt_dofadr[model.eq_obj2id[i]]
            ties[follower] = model.eq_data[i, 1] * ties[leader]
            led.append(int(follower))
    return np.delete(ties, led, axis=1)
