"""The sub-steps of several steps in one call of MuJoCo, which no other thread of Python waits for."""

from __future__ import annotations

import copy

import mujoco
import numpy as np
from mujoco.batch import Batch

from schemas.vectors import Vector

__all__ = ["Ahead"]

_WHOLE = mujoco.mjtState.mjSTATE_INTEGRATION


class Ahead:
    """A copy of a simulation without sensors, for steps with controls that are known ahead.

    The last sub-step is that of the simulation itself, with sensors. Bits are those of single steps.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Copy `model` as it is now; `data` is the simulation."""
        self._model, self._data = model, data
        quiet = copy.copy(model)
        quiet.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_SENSOR)
        self._batch = Batch(quiet, nsim=1, nthread=1)
        self._row: Vector = self._batch.state[0]

    def run(self, controls: Vector, sub_steps: int) -> tuple[Vector, Vector]:
        """Go on until a sub-step before the end of the steps with `controls`, shape (n, nu).

        Returns `qpos`, shape (n - 1, nq), and positions of bodies, shape (n - 1, nbody, 3), at the ends of
        all steps but the last; call `finish` then.
        """
        mujoco.mj_getState(self._model, self._data, self._row, int(_WHOLE))
        count = len(controls) * sub_steps - 1
        if not count:
            return np.empty((0, self._model.nq)), np.empty((0, self._model.nbody, 3))
        control = np.repeat(controls, sub_steps, axis=0)[:count]
        found = self._batch.rollout(count, control[None], record=("qpos", "xpos"))
        # positions of bodies are those before a sub-step, `qpos` after
        return found["qpos"][0, sub_steps - 1 :: sub_steps], found["xpos"][0, sub_steps::sub_steps]

    def finish(self, control: Vector) -> None:
        """Take the last sub-step in the simulation itself."""
        mujoco.mj_setState(self._model, self._data, self._row, int(_WHOLE))
        trouble = self._batch.warning[0, :, 1]
        numbers = self._data.warning.number
        numbers += trouble
        trouble[:] = 0
        self._data.ctrl = control
        mujoco.mj_step(self._model, self._data)
        mujoco.mj_step1(self._model, self._data)

    def show(self, qpos: Vector) -> None:
        """Compute poses and contacts at `qpos`, shape (nq,), in the simulation; `finish` ends that."""
        self._data.qpos = qpos
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_collision(self._model, self._data)
