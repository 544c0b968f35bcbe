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
from robots import rotation
from robots.dvrk.mounted import AnyArm, MountedMtm
from robots.dvrk.setup_joints import DrivenArm
from schemas.vectors import Vector

__all__ = ["Hands"]


class Hands:
    """The hands on all masters of a scene."""

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, arms: Mapping[DrivenArm, AnyArm], period: float
    ) -> None:
        """Find the hands of `arms`, stepped every `period` seconds."""
        self._model, self._data, self._period = model, data, period
        masters = {name: arm for name, arm in arms.items() if isinstance(arm, MountedMtm)}
        self._viewers = {name: arm.viewer_pose for name, arm in masters.items()}
        self._mocap = {name: int(model.body(hand_name(name)).mocapid[0]) for name in masters}
        self._actuators = {
            name: [model.actuator(f"{hand_name(name)}/{way}").id for way in ACTUATORS] for name in masters
        }
        self._gains = model.actuator_gainprm.copy(), model.actuator_biasprm.copy()
        self._state = np.zeros((len(masters), 8))
        self._poses, self._grips = self._state[:, :7], self._state[:, 7]
        self._poses[:, 6] = 1.0
        self.outputs = {f"{name}/hand_cf": np.zeros(6) for name in masters}
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
        for i, name in enumerate(self._mocap):
            pose, grip = inputs[f"{name}/hand_cp"], float(np.clip(inputs[f"{name}/hand_grip"][0], 0.0, 1.0))
            velocity = np.zeros(6)
            if grip and self._grips[i]:
                before = self._poses[i]
                velocity[:3] = (pose[:3] - before[:3]) / self._period
                turn = rotation.product(pose[3:], rotation.conjugate(before[3:]))
                velocity[3:] = rotation.log(turn) / self._period
            self._poses[i] = pose
            if grip != self._grips[i]:
                self._grips[i] = grip
                self._hold(i, name)
            self._place(i, name, velocity)

    def _hold(self, i: int, name: str) -> None:
        actuators, (gain, bias) = self._actuators[name], self._gains
        self._model.actuator_gainprm[actuators] = gain[actuators] * self._grips[i]
        self._model.actuator_biasprm[actuators] = bias[actuators] * self._grips[i]

    def _place(self, i: int, name: str, velocity: Vector) -> None:
        """Put the hand at its pose, and let its damper act against its own velocity (6,), viewer's frame."""
        viewer, mocap = self._viewers[name], self._mocap[name]
        self._data.mocap_pos[mocap] = viewer[:3, :3] @ self._poses[i, :3] + viewer[:3, 3]
        turned = rotation.product(rotation.from_matrix(viewer), self._poses[i, 3:])
        self._data.mocap_quat[mocap] = turned[[3, 0, 1, 2]]
        to_hand = rotation.matrix(self._poses[i, 3:]).T
        along = np.concatenate([to_hand @ velocity[:3], to_hand @ velocity[3:]])
        for actuator, speed in zip(self._actuators[name], along.tolist(), strict=True):
            self._data.ctrl[int(self._model.actuator_ctrladr[actuator]) + 1] = speed

    def update(self) -> None:
        """Read the forces on the hands, in the viewer's frame."""
        for i, (name, actuators) in enumerate(self._actuators.items()):
            turn, felt = rotation.matrix(self._poses[i, 3:]), -self._data.actuator_force[actuators]
            wrench = self.outputs[f"{name}/hand_cf"]
            wrench[:3], wrench[3:] = turn @ felt[:3], turn @ felt[3:]

    def refresh(self) -> None:
        """Take over a restored state."""
        for i, name in enumerate(self._mocap):
            self._hold(i, name)
        self.update()
