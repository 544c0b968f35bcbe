"""The bond at a thread: its nodes, which tissue pushes on where the thread runs through it.

A node moves as 50 mg, and tissue is stiff. As with a needle (`wire`), the tissue's viscosity acts in MuJoCo's
implicit step on every node that a force comes to. Such a node is in the tissue, so the level that the thread
lies on does not hold it up.
"""

from __future__ import annotations

import mujoco
import numpy as np

from engines.mujoco.model.thread import node_body
from engines.mujoco.ports import THREAD
from hub.participant import Inputs, MotionSide
from robots.training.threads import ThreadParams
from schemas.vectors import Vector

__all__ = ["Strand"]

_DEEP = 1.0
"""How far below the level a node in tissue may go, m: as far as it likes."""


class Strand:
    """Views of the model's data that belong to the nodes of one thread."""

    acts_off_centre = False

    def __init__(
        self,
        thing: str,
        params: ThreadParams,
        motion: MotionSide,
        model: mujoco.MjModel,
        data: mujoco.MjData,
    ) -> None:
        """Let `motion` act on the thread of the needle `thing`."""
        self.motion, self.bond = motion, f"{thing}/{THREAD}"
        count = params.segments
        first = model.body(node_body(thing, 1)).id
        joint = int(model.body_jntadr[first])
        dofs = slice(at := int(model.jnt_dofadr[joint]), at + 3 * count)
        self._velocity_of, self._damping = data.qvel[dofs], model.dof_damping[dofs].reshape(count, 3)
        self._place = data.xpos[first : first + count]
        self._load = data.xfrc_applied[first : first + count, :3]
        self._floor = model.jnt_range[joint : joint + 3 * count].reshape(count, 3, 2)[:, 2, 0]
        self._level, self._drag = self._floor.copy(), params.drag
        self._inside = np.zeros(count)
        self._position, self._velocity = np.zeros(3 * count), np.zeros(3 * count)
        self._force = np.zeros(3 * count)
        self.outputs = motion.result(self._position, self._velocity)
        self.refresh()

    def begin(self, inputs: Inputs) -> None:
        """Apply the reaction of the step that begins, and the drag where there is one."""
        self.motion.begin(inputs, self._position, self._velocity)
        self._push(0.0)

    def renew(self, tau: float) -> None:
        """Record the work done, and renew the forces `tau` seconds into the step."""
        self.end()
        self._push(tau)

    def end(self) -> None:
        """Record the work done."""
        before = self._position.copy()
        self.refresh()
        self.motion.add(self._force, self._position - before)

    def refresh(self) -> None:
        """Take the nodes of the model's present state as those from which work counts."""
        self._position.reshape(-1, 3)[:] = self._place
        self._velocity[:] = self._velocity_of

    @staticmethod
    def least_mass(params: ThreadParams, timestep: float) -> float:
        """Return the mass (kg) that a force on a node meets in a sub-step, drag included; edges add to it."""
        return params.node_mass + timestep * params.drag

    def _push(self, tau: float) -> None:
        self._force = self.motion.force(tau, self._position, self._velocity)
        self._load[:] = self._force.reshape(-1, 3)
        self.state = self._load.any(axis=1).astype(float)

    @property
    def state(self) -> Vector:
        """Which nodes are in tissue, 1 or 0: the model has their drag and range, which are no state there."""
        return self._inside

    @state.setter
    def state(self, state: Vector) -> None:
        self._inside[:] = state
        self._damping[:] = self._drag * self._inside[:, None]
        self._floor[:] = np.where(self._inside, -_DEEP, self._level)
