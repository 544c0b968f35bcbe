"""The whole efforts of the motors of an arm, as a real arm's currents tell them.

The dVRK's `measured_js` has the efforts that its controllers measure as motor currents (sawControllers,
mtsPID: IO.measured_js), and its gravity compensation is part of what they command (feed_forward/servo_jf).
Of a simulated arm the sensors report the servos alone: its weight hangs on MuJoCo's `gravcomp`, and the
implicit integrator lets a servo give way to the acceleration within a sub-step, by its derivative gain times
timestep times acceleration (`implicitfast` in MuJoCo's documentation). Both are added here.

The effort is that of the last sub-step: with one sub-step in a step it is the one that acted.
"""

from __future__ import annotations

import mujoco
import numpy as np

from engines.mujoco.model.leading import to_all_joints
from robots.dvrk.mounted.mounted_arms import AnyArm
from robots.dvrk.setup_joints import DrivenArm
from schemas.vectors import Vector

__all__ = ["Motors"]


class Motors:
    """Joint states with whole efforts, by arm."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Watch this model."""
        self._model, self._data = model, data
        self._rows: list[tuple[Vector, Vector, Vector, list[int], list[int]]] = []

    def add(self, arm: DrivenArm, params: AnyArm, sensed: Vector) -> Vector:
        """Return the joint state of `arm`, shape (3 n,), from the sensors' joint state, same shape."""
        names = [f"{arm}/{joint.name}" for joint in params.chain.joints]
        whole = np.empty_like(sensed)
        self._rows.append(
            (
                sensed,
                whole,
                to_all_joints(self._model, arm, params).T,
                [self._model.actuator(name).id for name in names],
                [int(self._model.joint(name).dofadr[0]) for name in names],
            )
        )
        return whole

    def update(self) -> None:
        """Update the joint states."""
        model, data = self._model, self._data
        for sensed, whole, to_own, actuators, dofs in self._rows:
            whole[:] = sensed
            gains = model.actuator_biasprm[actuators, 2]  # negative
            whole[-len(dofs) :] += to_own @ data.qfrc_gravcomp + model.opt.timestep * gains * data.qacc[dofs]
