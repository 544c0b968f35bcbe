"""One arm inside the running model: its ports, its command, what it reports, and its bond at the probe."""

from __future__ import annotations

import mujoco
import numpy as np

from engines.mujoco.model import first_sensor, probe_body
from engines.mujoco.params import PsmParams
from hub.bond import MotionSide
from hub.inputs import Inputs
from robots.dvrk import psm

__all__ = ["RunningArm"]

_JOINTS = len(psm.JOINT_NAMES)
_POSES = np.array([18, 19, 20, 22, 23, 24, 21, 25, 26, 27, 29, 30, 31, 28])
"""Where two poses (x, y, z, qx, qy, qz, qw), tip in base and tip in world, stand in the arm's sensors (quaternions w first)."""
_POSITION, _QUATERNION, _TWIST = slice(25, 28), slice(28, 32), slice(32, 38)
"""Of the tip in the world, in the arm's sensors."""
_W_FIRST = [6, 3, 4, 5]
"""MuJoCo's quaternion in a ROS pose."""


class RunningArm:
    """Views of the model's data that belong to one arm; nothing is allocated in a step."""

    def __init__(self, name: str, params: PsmParams, model: mujoco.MjModel, data: mujoco.MjData, period: float) -> None:
        """Bind the arm called `name`, which is stepped every `period` seconds, and put it where it starts."""
        self.name, self._model, self._data = name, model, data
        self._lower, self._upper = params.chain.lower, params.chain.upper
        first = f"{name}/{psm.JOINT_NAMES[0]}"
        joint, control = int(model.joint(first).qposadr[0]), int(model.actuator_ctrladr[model.actuator(first).id])
        data.qpos[joint : joint + _JOINTS] = params.start
        self._setpoints = np.array([params.start, params.start]).ravel()  # now, and one step ago
        self._setpoint, self._previous = self._setpoints[:_JOINTS], self._setpoints[_JOINTS:]
        self._servo = data.ctrl[control : control + 2 * _JOINTS]  # per joint: position, velocity
        # The velocity setpoint is the slope of the position setpoint: one product lays out all inputs of the servos.
        now = np.eye(_JOINTS)
        self._layout = np.zeros((2 * _JOINTS, 2 * _JOINTS))
        self._layout[::2, :_JOINTS], self._layout[1::2, :_JOINTS], self._layout[1::2, _JOINTS:] = now, now / period, -now / period
        self._layout.dot(self._setpoints, self._servo)
        self._body = model.body(probe_body(name)).id
        self._wrench = data.xfrc_applied[self._body]  # at the body's centre of mass, which is the probe's centre; (6,)
        self._torque = self._wrench[3:].data
        sensor = int(model.sensor(first_sensor(name)).adr[0])
        self._sensors = data.sensordata[sensor : sensor + _TWIST.stop]
        self._world_position, self._world_quaternion, self._twist = (self._sensors[part] for part in (_POSITION, _QUATERNION, _TWIST))
        self._poses = np.empty(14)
        self._pose = self._poses[7:]
        self._moved, self._turned = np.zeros(6), np.empty(3)
        self._translation, self._rotation = self._moved[:3], self._moved[3:]
        self._motion: MotionSide | None = None
        self._command_port = f"{name}/servo_jp"
        self.outputs = {f"{name}/measured_js": self._sensors[: 3 * _JOINTS], f"{name}/setpoint_js": self._setpoint, f"{name}/measured_cp": self._poses[:7]}

    def couple(self, motion: MotionSide) -> None:
        """Let `motion` act on the probe."""
        self._motion = motion
        self.outputs |= motion.result(self._pose, self._twist)

    def begin(self, inputs: Inputs) -> None:
        """Take the command and the reaction for the step that begins."""
        self._previous[:] = self._setpoint
        np.maximum(inputs[self._command_port], self._lower, out=self._setpoint)
        np.minimum(self._setpoint, self._upper, out=self._setpoint)
        self._layout.dot(self._setpoints, self._servo)
        if self._motion is not None:
            self._motion.begin(inputs, self._pose, self._twist)
            self._wrench[:] = self._motion.force(0.0, self._pose, self._twist)

    def correct(self, tau: float) -> None:
        """Follow the bond's correction: a new wrench from `tau` seconds into the step on."""
        if self._motion is not None:
            self.end()
            self._wrench[:] = self._motion.force(tau, self._pose, self._twist)

    def end(self) -> None:
        """Book the work of the wrench since it was set, and bring the outputs up to the model's present state."""
        if self._motion is not None:
            np.subtract(self._world_position, self._pose[:3], out=self._translation)  # the pose is still the one before
            if any(self._torque):  # a sphere in contact feels none
                mujoco.mju_subQuat(self._turned, self._world_quaternion, self._pose[_W_FIRST])  # in the probe's own axes
                mujoco.mju_rotVecQuat(self._rotation, self._turned, self._world_quaternion)
            self._motion.add(self._wrench, self._moved)
        self._sensors.take(_POSES, None, self._poses, "clip")  # three times as fast as the default mode

    def refresh(self) -> None:
        """Follow the model after its state was set from outside."""
        self._setpoint[:] = self._servo[::2]
        self._sensors.take(_POSES, None, self._poses, "clip")

    def effective_mass(self) -> float:
        """Return the least mass (kg) that a force on the probe meets in any direction: 1 / max eig(J M^-1 J^T)."""
        jacobian, inertia = np.zeros((3, self._model.nv)), np.zeros((self._model.nv, self._model.nv))
        mujoco.mj_jacBody(self._model, self._data, jacobian, None, self._body)
        mujoco.mj_fullM(self._model, self._data, inertia)
        return float(1.0 / np.linalg.eigvalsh(jacobian @ np.linalg.solve(inertia, jacobian.T))[-1])
