"""What the arms report, out of the model's sensors."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np
from numpy.typing import NDArray

from engines.mujoco.arms.motors import Motors
from engines.mujoco.arms.servos import Servos
from engines.mujoco.model import FINGERS, first_sensor
from engines.mujoco.model.poses import ROS_ORDER
from engines.mujoco.params import has_jaw
from robots.dvrk.mounted import MountedEcm, MountedPsm
from robots.dvrk.setup_joints import CartArm
from schemas.vectors import Vector

__all__ = ["Readings"]

_JAW = np.array(
    [[1.0, 1.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.5, 0.5]]
)
"""From those of its two fingers to position, velocity and effort of a jaw: opened by both, with the torque of
either.
"""
_ROLLING_JAW = np.zeros((6, 9))
"""From those of the two fingers and the roller to those of the jaw and the roller, alternating."""
_ROLLING_JAW[::2, :6], _ROLLING_JAW[1::2, 6:] = _JAW, np.eye(3)


class Readings:
    """Views of the model's sensors by output port; what is no view is copied when it is due."""

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        arms: Mapping[CartArm, MountedPsm | MountedEcm],
        servos: Servos,
        positions: Vector | None = None,
        *,
        weighs: bool = False,
    ) -> None:
        """Report on `arms`; `weighs`: by the whole efforts of their motors.

        `positions` is the matrix to the positions of the whole model, where this one is lean.
        """
        self._whole = positions
        self._sensors = data.sensordata
        self._qpos = np.empty(model.nq if positions is None else len(positions))
        self._positions = data.qpos
        self._jaws: list[tuple[Vector, Vector, Vector]] = []
        self._motors = Motors(model, data) if weighs else None
        poses: list[NDArray[np.intp]] = []
        self._poses = np.empty(7 * len(arms))
        self.outputs: dict[str, Vector] = {"qpos": self._qpos}
        for i, (arm, params) in enumerate(arms.items()):
            first, n = int(model.sensor(first_sensor(arm)).adr[0]), len(params.chain.joints)
            poses.append(first + 3 * n + ROS_ORDER)
            self.outputs[f"{arm}/measured_js"] = measured = self._sensors[first : first + 3 * n]
            if self._motors is not None:
                self.outputs[f"{arm}/measured_js"] = self._motors.add(arm, params, measured)
            self.outputs[f"{arm}/setpoint_js"] = servos.arm_setpoint(arm)
            self.outputs[f"{arm}/measured_cp"] = self._poses[7 * i : 7 * i + 7]
            if isinstance(params, MountedPsm) and has_jaw(params):
                fingers = int(model.sensor(f"{arm}/position/{FINGERS[0]}").adr[0])
                jaw = self.outputs[f"{arm}/jaw/measured_js"] = np.empty(3 * len(params.tool.jaw_joints))
                matrix = _JAW if params.tool.roller is None else _ROLLING_JAW
                self._jaws.append((matrix, self._sensors[fingers : fingers + matrix.shape[1]], jaw))
            elif isinstance(params, MountedPsm) and (hand := params.tool.hand) is not None:
                fingers, k, m = (
                    int(model.sensor(f"{arm}/position/{hand.fingers[0]}").adr[0]),
                    3 * len(hand.joints),
                    3 * len(hand.links),
                )
                self.outputs[f"{arm}/hand/measured_js"] = self._sensors[fingers : fingers + k]
                self.outputs[f"{arm}/hand/phalanges/measured_js"] = self._sensors[
                    fingers + k : fingers + k + m
                ]
        self._where = np.concatenate(poses)
        self.update()

    def update(self) -> None:
        """Update what is due in every step."""
        for matrix, fingers, jaw in self._jaws:
            matrix.dot(fingers, jaw)
        if self._motors is not None:
            self._motors.update()

    def refresh(self) -> None:
        """Update what is published less often: the tips' poses and the model's positions."""
        self._sensors.take(self._where, None, self._poses, "clip")  # three times as fast as the default mode
        if self._whole is None:
            self._qpos[:] = self._positions
        else:
            self._whole.dot(self._positions, self._qpos)
