"""The equations of motion of one arm, in its independent joints: M(q) a + gravity(q) + elastic(q) + friction(v) = effort.

The linkage, and the fingers held closed, move with the joints that lead them: with v = G u, from the velocities u of the
independent joints to those of all, the inertia is G' M G and a load G' f.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from engines.mujoco.model.scene import build
from engines.mujoco.model.tree import links
from engines.mujoco.params import SceneArm, SceneParams
from schemas.vectors import Vector

__all__ = ["JointDynamics", "dynamics"]


@dataclass(frozen=True)
class JointDynamics:
    """At one configuration; rad, m, N m, N, by joint in the order of `joints`."""

    joints: tuple[str, ...]
    inertia: Vector
    """Joint-space inertia matrix, shape (n, n)."""
    gravity: Vector
    """Effort that holds the arm against gravity, its base upright, shape (n,)."""
    viscous_friction: Vector
    """Effort per velocity, shape (n,)."""
    coulomb_friction: Vector
    """Effort while moving, shape (n,)."""
    elastic_stiffness: Vector
    """Shape (n,)."""
    elastic: Vector
    """Effort that holds the arm against its springs, shape (n,)."""


def dynamics(arm: SceneArm, instrument: str | None, q: Sequence[float]) -> JointDynamics:
    """Return the dynamics of `arm`, alone with its base upright, at joint positions `q` (rad, m).

    Args:
        arm: PSM1, PSM2, PSM3 or ECM.
        instrument: of a PSM, by name or number; endoscope of the ECM; None for the usual one.
        q: one number per joint, in range.
    """
    what = {} if instrument is None else {"endoscope" if arm == "ECM" else "instrument": instrument}
    scene = SceneParams.model_validate({"arms": {arm: what}, "looks": False})
    params = scene.arms[arm]
    model = build(scene)
    data = mujoco.MjData(model)
    joints = [joint.name for joint in params.chain.joints]
    to_all = np.zeros((model.nv, len(joints)))
    for link in links(arm, params):
        leader, ratio = (link.follow.joint, link.follow.ratio) if link.follow else (link.name, 1.0)
        if leader in joints:
            to_all[int(model.joint(f"{arm}/{link.name}").dofadr[0]), joints.index(leader)] = ratio
    data.qpos[:] = to_all @ q
    mujoco.mj_forward(model, data)
    inertia = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, inertia)
    return JointDynamics(
        joints=tuple(joints),
        inertia=to_all.T @ inertia @ to_all,
        gravity=to_all.T @ data.qfrc_bias,
        viscous_friction=to_all.T @ model.dof_damping,
        coulomb_friction=to_all.T @ model.dof_frictionloss,
        elastic_stiffness=to_all.T @ model.jnt_stiffness,
        elastic=to_all.T @ (model.jnt_stiffness * (data.qpos - model.qpos_spring)),
    )
