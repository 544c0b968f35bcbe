"""The least mass of the model under a force."""

from __future__ import annotations

import mujoco
import numpy as np

from schemas.vectors import Vector

__all__ = ["effective_mass"]


def effective_mass(jacobian: Vector, model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Return the least mass (kg) under a force in any direction: 1 / max eig(J M^-1 J^T).

    The joints of the linkage follow others: J and M are of the independent joints.

    Args:
        jacobian: J of the velocity J dq, shape (k, nv); of several points stacked.
        model: the model.
        data: computed at the present positions.
    """
    inertia = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, inertia)
    ties = _followers(model)
    jacobian, inertia = jacobian @ ties, ties.T @ inertia @ ties
    return float(1.0 / np.linalg.eigvalsh(jacobian @ np.linalg.solve(inertia, jacobian.T))[-1])


def _followers(model: mujoco.MjModel) -> Vector:
    """Return T, shape (nv, independent), with dq = T dq_independent.

    Joint equalities of the model enter as ratios of velocities.
    """
    ties, led = np.eye(model.nv), list[int]()
    for i in range(model.neq):
        if model.eq_type[i] == mujoco.mjtEq.mjEQ_JOINT and model.eq_active0[i]:
            follower, leader = model.jnt_dofadr[model.eq_obj1id[i]], model.jnt_dofadr[model.eq_obj2id[i]]
            ties[follower] = model.eq_data[i, 1] * ties[leader]
            led.append(int(follower))
    return np.delete(ties, led, axis=1)
