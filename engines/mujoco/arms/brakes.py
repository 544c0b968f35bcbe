"""The brakes of the ECM: they hold the joints while the drives are off."""

from __future__ import annotations

import mujoco
import numpy as np

from engines.mujoco.model import ties
from engines.mujoco.params import SceneParams
from schemas.vectors import Vector

__all__ = ["Brakes"]


class Brakes:
    """The brakes of the ECM: they hold the joints while the drives are off."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, scene: SceneParams) -> None:
        """Find the brakes added by `engines.mujoco.model.ties`."""
        arm = scene.arms.get(ties.BRAKED)
        joints = [] if arm is None else [joint.name for joint in arm.chain.joints]
        self._model, self._data = model, data
        self._locks = [model.equality(ties.brake(joint)).id for joint in joints]
        self._positions = [int(model.joint(f"{ties.BRAKED}/{joint}").qposadr[0]) for joint in joints]
        self._on = False
        self._state = np.array([*model.eq_data[self._locks, 0], self._on], float)

    def set(self, on: bool) -> None:
        """Close or open the brakes; closed brakes keep the positions of closing."""
        if on != self._on:
            self._data.eq_active[self._locks] = on
            self.state = np.array([*self._data.qpos[self._positions], on])

    @property
    def state(self) -> Vector:
        """State beyond MuJoCo's: positions of closing, then 1 if closed; the same array at every call."""
        return self._state

    @state.setter
    def state(self, state: Vector) -> None:
        self._state[:] = state
        self._model.eq_data[self._locks, 0] = state[:-1]
        self._on = bool(state[-1])
