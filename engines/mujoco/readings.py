"""What the arms report, out of the model's sensors, and where they start."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np
from numpy.typing import NDArray

from engines.mujoco.model import FINGERS, first_sensor
from engines.mujoco.model.tree import links
from engines.mujoco.params import EcmParams, PsmParams
from engines.mujoco.ports import has_jaw
from engines.mujoco.servos import Servos
from robots.dvrk.rolling_needle_driver import PADS
from robots.dvrk.setup_joints import CartArm
from schemas.vectors import Vector

__all__ = ["Readings", "place"]

_POSE = np.array([0, 1, 2, 4, 5, 6, 3])
"""Where a pose (x, y, z, qx, qy, qz, qw) stands among MuJoCo's sensors, with quaternions w first."""
_JAW = np.array(
    [[1.0, 1.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.5, 0.5]]
)
"""Position, velocity and effort of a jaw of those of its two fingers: opened by both, with the torque of
either.
"""
_ROLLING_JAW = np.zeros((6, 9))
"""The same of a jaw and its roller by turns, of those of the two fingers and the roller."""
_ROLLING_JAW[::2, :6], _ROLLING_JAW[1::2, 6:] = _JAW, np.eye(3)


def place(model: mujoco.MjModel, data: mujoco.MjData, arms: Mapping[CartArm, PsmParams | EcmParams]) -> None:
    """Put the joints of `arms`, with linkages and fingers, where they start."""
    for arm, params in arms.items():
        start = dict(zip((joint.name for joint in params.chain.joints), params.start, strict=True))
        if isinstance(params, PsmParams) and (hand := params.tool.hand) is not None:
            start |= dict(
                zip(
                    (link.name for link in hand.links),
                    hand.unloaded(np.array(params.hand)).ravel().tolist(),
                    strict=True,
                )
            )
        start |= dict.fromkeys(PADS, 0.0)
        for link in links(arm, params):
            if link.follow is not None:
                q = link.follow.ratio * start[link.follow.joint]
            elif link.name in FINGERS and isinstance(params, PsmParams):
                q = params.jaw / 2.0
            else:
                q = start[link.name]
            data.qpos[int(model.joint(f"{arm}/{link.name}").qposadr[0])] = q


class Readings:
    """Views of the model's sensors by output port; what is no view is copied when it is due."""

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        arms: Mapping[CartArm, PsmParams | EcmParams],
        servos: Servos,
    ) -> None:
        """Report on `arms`."""
        self._sensors, self._qpos = data.sensordata, np.empty(model.nq)
        self._positions = data.qpos
        self._jaws: list[tuple[Vector, Vector, Vector]] = []
        poses: list[NDArray[np.intp]] = []
        self._poses = np.empty(7 * len(arms))
        self.outputs: dict[str, Vector] = {"qpos": self._qpos}
        for i, (arm, params) in enumerate(arms.items()):
            first, n = int(model.sensor(first_sensor(arm)).adr[0]), len(params.chain.joints)
            poses.append(first + 3 * n + _POSE)
            self.outputs[f"{arm}/measured_js"] = self._sensors[first : first + 3 * n]
            self.outputs[f"{arm}/setpoint_js"] = servos.arm_setpoint(arm)
            self.outputs[f"{arm}/measured_cp"] = self._poses[7 * i : 7 * i + 7]
            if isinstance(params, PsmParams) and has_jaw(params):
                fingers = int(model.sensor(f"{arm}/position/{FINGERS[0]}").adr[0])
                jaw = self.outputs[f"{arm}/jaw/measured_js"] = np.empty(3 * len(params.tool.jaw_joints))
                matrix = _JAW if params.tool.roller is None else _ROLLING_JAW
                self._jaws.append((matrix, self._sensors[fingers : fingers + matrix.shape[1]], jaw))
            elif isinstance(params, PsmParams) and (hand := params.tool.hand) is not None:
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
        """Bring up to date what is due in every step."""
        for matrix, fingers, jaw in self._jaws:
            matrix.dot(fingers, jaw)

    def refresh(self) -> None:
        """Bring up to date what is published more seldom: the tips' poses and the model's positions."""
        self._sensors.take(self._where, None, self._poses, "clip")  # three times as fast as the default mode
        self._qpos[:] = self._positions
