"""Joint states and poses of the arms, from the model's sensors."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import groupby

import mujoco
import numpy as np
from numpy.typing import NDArray

from engines.mujoco.arms.motors import Motors
from engines.mujoco.arms.servos import Servos
from engines.mujoco.model import first_sensor
from engines.mujoco.model.end_effector import sensed_motors
from engines.mujoco.model.poses import ROS_ORDER
from robots.dvrk.end_effectors.end_effector import EndEffector
from robots.dvrk.mounted.mounted_arm import MountedArm
from robots.dvrk.mounted.mounted_arms import AnyArm
from robots.dvrk.setup_joints import DrivenArm
from schemas.vectors import Vector

__all__ = ["Readings"]

_EFFORT = 2
"""Place of efforts in a joint state, after positions and velocities."""


class Readings:
    """Views of the model's sensors by output port; other values are copied when due."""

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        arms: Mapping[DrivenArm, AnyArm],
        servos: Servos,
        positions: Vector | None = None,
        *,
        weighs: bool = False,
        engaged: Callable[[], Mapping[str, int]] = dict[str, int],
    ) -> None:
        """Report on `arms`.

        Args:
            model: the model.
            data: its state.
            arms: the arms.
            servos: their drives.
            positions: for a lean model, the matrix to the positions of the whole model.
            weighs: whether efforts are the whole efforts of the motors.
            engaged: returns the number of the engaged instrument by arm, where there are spares.
        """
        self._engaged = engaged
        self._jaws: list[tuple[str, list[tuple[Vector, Vector] | None], Vector]] = []
        """Arm with spares, for each instrument the matrix to joints and the sensors, and the output."""
        self._whole = positions
        self._sensors = data.sensordata
        self._qpos = np.empty(model.nq if positions is None else len(positions))
        self._positions = data.qpos
        self._end_effectors: list[tuple[Vector, Vector, Vector]] = []
        self._motors = Motors(model, data) if weighs else None
        poses: list[NDArray[np.intp]] = []
        self._poses = np.empty(7 * len(arms))
        self.outputs: dict[str, Vector] = {"qpos": self._qpos}
        for i, (arm, params) in enumerate(arms.items()):
            first, n = _first_sensor(model, arm, params), len(params.chain.joints)
            poses.append(first + 3 * n + ROS_ORDER)
            self.outputs[f"{arm}/measured_js"] = measured = self._sensors[first : first + 3 * n]
            if self._motors is not None:
                self.outputs[f"{arm}/measured_js"] = self._motors.add(arm, params, measured)
            self.outputs[f"{arm}/setpoint_js"] = servos.arm_setpoint(arm)
            self.outputs[f"{arm}/measured_cp"] = self._poses[7 * i : 7 * i + 7]
            self._add_end_effector(model, arm, params)
        self._where = np.concatenate(poses)
        self.update()

    def _add_end_effector(self, model: mujoco.MjModel, arm: str, params: MountedArm) -> None:
        """Report the joints of an end effector, and links with readings."""
        effector = params.end_effector
        if len(params.variants) > 1:
            self._add_jaws(model, arm, params)
            return
        if not effector.joints:
            return
        to_joints = _to_joints(effector)
        count = to_joints.shape[1]
        first = next(name for group in sensed_motors(effector) for name in group)
        at = int(model.sensor(f"{arm}/position/{first}").adr[0])
        sensed, port = self._sensors[at : at + count], f"{arm}/{effector.name}/measured_js"
        if np.array_equal(to_joints, np.eye(count)):
            self.outputs[port] = sensed
        else:
            self.outputs[port] = joints = np.empty(len(to_joints))
            self._end_effectors.append((to_joints, sensed, joints))
        at += count
        for reading, links in groupby(params.end_effector_links, lambda link: link.reading):
            if reading:
                size = 3 * len(list(links))
                port = f"{arm}/{effector.name}/{reading}/measured_js"
                self.outputs[port] = self._sensors[at : at + size]
                at += size

    def _add_jaws(self, model: mujoco.MjModel, arm: str, params: MountedArm) -> None:
        """Report the jaw of the engaged instrument; zeros where that has none."""
        jaws: list[tuple[Vector, Vector] | None] = []
        for owner, one in params.by_owner(arm).items():
            if one.end_effector.joints:
                to_joints = _to_joints(one.end_effector)
                first = next(name for group in sensed_motors(one.end_effector) for name in group)
                at = int(model.sensor(f"{owner}/position/{first}").adr[0])
                jaws.append((to_joints, self._sensors[at : at + to_joints.shape[1]]))
            else:
                jaws.append(None)
        sizes = {len(jaw[0]) for jaw in jaws if jaw is not None}
        if sizes:
            self.outputs[f"{arm}/jaw/measured_js"] = joints = np.zeros(sizes.pop())
            self._jaws.append((arm, jaws, joints))

    def update(self) -> None:
        """Update the outputs due in every step."""
        for arm, jaws, joints in self._jaws:
            if (jaw := jaws[self._engaged()[arm]]) is None:
                joints[:] = 0.0
            else:
                jaw[0].dot(jaw[1], joints)
        for to_joints, sensed, joints in self._end_effectors:
            to_joints.dot(sensed, joints)
        if self._motors is not None:
            self._motors.update()

    def refresh(self) -> None:
        """Update the outputs published less often: the tips' poses and the model's positions."""
        self._sensors.take(self._where, None, self._poses, "clip")  # three times as fast as the default mode
        if self._whole is None:
            self._qpos[:] = self._positions
        else:
            self._whole.dot(self._positions, self._qpos)


def _to_joints(effector: EndEffector) -> Vector:
    """Return the matrix from the sensors of an end effector's motors to its joint state.

    The joint state has positions, velocities and efforts of all joints. Positions of motors of the same joint
    add up; efforts add up by the motors' shares, for equal work.
    """
    joints = [joint.name for joint in effector.joints]
    columns: list[Vector] = []
    for group in sensed_motors(effector):
        for quantity in range(3):
            for motor in group.values():
                column = np.zeros(3 * len(joints))
                row = quantity * len(joints) + joints.index(motor.joint)
                column[row] = motor.share if quantity == _EFFORT else 1.0
                columns.append(column)
    return np.column_stack(columns)


def _first_sensor(model: mujoco.MjModel, arm: str, params: MountedArm) -> int:
    """Return where the sensors of an arm begin; their order is that of `engines.mujoco.model.names`."""
    return int(model.sensor(first_sensor(arm, params.chain.joints[0].name)).adr[0])
