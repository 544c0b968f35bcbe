"""The dry friction of an arm's joints and discs: soft under a position servo, hard where no servo holds."""

from __future__ import annotations

import mujoco
import numpy as np

__all__ = ["Friction"]

_DRY_REFERENCE = (1e-3, 1.0)
"""Time constant (s) and damping ratio: twice the default sub-step, the shortest allowed by MuJoCo."""
_DRY_IMPEDANCE = (0.9999, 0.9999, 1e-3, 0.5, 2.0)


class Friction:
    """The dry friction of an arm.

    MuJoCo's friction creeps under a load below its limit, in proportion to the load. Under a servo creep is
    of use: otherwise the servo would come to rest anywhere within friction over gain. An arm in effort mode
    would creep along on the springs.
    """

    def __init__(self, model: mujoco.MjModel, arm: str) -> None:
        """Find the friction of the joints and discs of `arm`."""
        self._model, own = model, f"{arm}/"
        joints = [i for i in range(model.njnt) if model.joint(i).name.startswith(own)]
        self._dofs = model.jnt_dofadr[joints]
        self._discs = [i for i in range(model.ntendon) if model.tendon(i).name.startswith(own)]
        self._soft = (
            model.dof_solref[self._dofs],
            model.dof_solimp[self._dofs],
            model.tendon_solref_fri[self._discs],
            model.tendon_solimp_fri[self._discs],
        )

    def set(self, *, dry: bool) -> None:
        """Make the friction hard, or as soft as before."""
        reference, impedance = np.array(_DRY_REFERENCE), np.array(_DRY_IMPEDANCE)
        hard = (reference, impedance, reference, impedance)
        model, values = self._model, hard if dry else self._soft
        model.dof_solref[self._dofs], model.dof_solimp[self._dofs] = values[:2]
        model.tendon_solref_fri[self._discs], model.tendon_solimp_fri[self._discs] = values[2:]
