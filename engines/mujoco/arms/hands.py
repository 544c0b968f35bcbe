"""The hands of a person on the masters' grippers: a spring and damper of six degrees of freedom each.

MuJoCo's actuators between two sites pull the gripper towards the hand, a body that follows its commands. The
spring acts in every sub-step. A hand that lets go leaves the master to its drives.
"""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np

from engines.mujoco.model.hands import ACTUATORS, hand_name
from hub.participant import Inputs
from robots.dvrk.mounted.mounted_arms import AnyArm
from robots.dvrk.mounted.mounted_mtm import MountedMtm
from robots.dvrk.setup_joints import DrivenArm
from robots.rotation import from_matrix
from schemas.vectors import Vector

__all__ = ["Hands"]

_WXYZ = [6, 3, 4, 5]
"""Places of a quaternion in a pose (x, y, z, qx, qy, qz, qw), in MuJoCo's order."""


class Hands:
    """The hands on all masters of a scene."""

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, arms: Mapping[DrivenArm, AnyArm], period: float
    ) -> None:
        """Find the hands of `arms`, stepped every `period` seconds."""
        masters = {name: arm for name, arm in arms.items() if isinstance(arm, MountedMtm)}
        self._state = np.zeros((len(masters), 8))
        self._state[:, 6] = 1.0
        self.outputs = {f"{name}/hand_cf": np.zeros(6) for name in masters}
        self._hands = [
            _Hand(name, arm, (model, data), period, self._state[i], self.outputs[f"{name}/hand_cf"])
            for i, (name, arm) in enumerate(masters.items())
        ]
        self.refresh()

    @property
    def state(self) -> Vector:
        """Poses of the hands in the viewer's frame, each with the firmness of the grip; the same array."""
        return self._state.reshape(-1)

    @state.setter
    def state(self, state: Vector) -> None:
        self._state.reshape(-1)[:] = state

    def begin(self, inputs: Inputs) -> None:
        """Take over the commands at the beginning of a step."""
        for hand in self._hands:
            hand.begin(inputs)

    def update(self) -> None:
        """Read the forces on the hands, in the viewer's frame."""
        for hand in self._hands:
            hand.feel()

    def refresh(self) -> None:
        """Take over a restored state."""
        for hand in self._hands:
            hand.hold()
            hand.feel()


class _Hand:
    """One hand; MuJoCo's own functions turn poses, at a fraction of the cost of numpy's."""

    def __init__(
        self,
        arm: str,
        params: MountedMtm,
        world: tuple[mujoco.MjModel, mujoco.MjData],
        period: float,
        state: Vector,
        felt: Vector,
    ) -> None:
        """Find the hand on `arm`.

        Args:
            arm: name of the master.
            params: its parameters.
            world: model and data.
            period: time between two steps, s.
            state: pose and firmness, shape (8,), written.
            felt: force and torque on the hand, shape (6,), written.
        """
        self._model, data = world
        self._period, self._felt = period, felt.reshape(2, 3)
        self._pose, self._grip = state[:7], state[7:]
        self._ports = f"{arm}/hand_cp", f"{arm}/hand_grip"
        viewer = params.viewer_pose
        self._viewer = viewer[:3, 3].copy(), from_matrix(viewer)[[3, 0, 1, 2]]
        name = hand_name(arm)
        mocap, first = (
            int(self._model.body(name).mocapid[0]),
            self._model.actuator(f"{name}/{ACTUATORS[0]}").id,
        )
        self._place = data.mocap_pos[mocap], data.mocap_quat[mocap]
        # the model has a hand's actuators one after the other, each with two inputs: position and velocity
        self._actuators, at = slice(first, first + 6), int(self._model.actuator_ctrladr[first])
        self._gain = self._model.actuator_gainprm[self._actuators].copy()
        self._bias = self._model.actuator_biasprm[self._actuators].copy()
        self._forces = data.actuator_force[self._actuators].reshape(2, 3)
        self._speeds = data.ctrl[at : at + 12].reshape(2, 3, 2)[..., 1]
        self._velocity = np.zeros((2, 3))
        self._turn, self._back, self._before = np.zeros(4), np.zeros(4), np.zeros(4)

    def begin(self, inputs: Inputs) -> None:
        """Put the hand at its pose, and let its damper act against its own velocity."""
        pose, grip = inputs[self._ports[0]], min(max(float(inputs[self._ports[1]][0]), 0.0), 1.0)
        if grip and self._grip[0]:
            self._find_velocity(pose)
        else:
            self._velocity[:] = 0.0
        self._pose[:] = pose
        self._turn[:] = pose[_WXYZ]
        if grip != self._grip[0]:
            self._grip[0] = grip
            self.hold()
        mujoco.mju_mulPose(*self._place, *self._viewer, self._pose[:3], self._turn)
        self._speeds[:] = self._velocity

    def _find_velocity(self, pose: Vector) -> None:
        """Find the velocity from the last pose to `pose`, (7,), along the axes of the hand."""
        self._before[:], self._turn[:] = self._pose[_WXYZ], pose[_WXYZ]
        mujoco.mju_negQuat(self._back, self._turn)
        mujoco.mju_rotVecQuat(self._velocity[0], pose[:3] - self._pose[:3], self._back)
        mujoco.mju_subQuat(self._velocity[1], self._turn, self._before)
        self._velocity /= self._period

    def hold(self) -> None:
        """Let the springs be as firm as the grip."""
        self._model.actuator_gainprm[self._actuators] = self._gain * self._grip[0]
        self._model.actuator_biasprm[self._actuators] = self._bias * self._grip[0]

    def feel(self) -> None:
        """Read the force on the hand, in the viewer's frame."""
        self._turn[:] = self._pose[_WXYZ]
        for felt, force in zip(self._felt, -self._forces, strict=True):
            mujoco.mju_rotVecQuat(felt, force, self._turn)
