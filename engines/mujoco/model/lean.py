"""A reduced model, for learning: arms without joints of the linkage and without contacts of covers.

The links of a parallelogram follow the joint that leads them, each by a tie that costs the solver a row and a
degree of freedom. Here they stand still, and the leading joint has what they add to its inertia, where the
arm starts, as rotor inertia. Turning the leading joint does not change that; the counterweight does, which
slides as the instrument is inserted. Left out is how the links change the inertia about yaw as they move.
"""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np

from engines.mujoco.model.scene import place
from engines.mujoco.model.tree import links
from engines.mujoco.params import SceneParams
from robots.dvrk.link import Follow
from schemas.vectors import Vector

__all__ = ["lean"]

_WRIST = ("roll", "wrist_pitch", "wrist_yaw")
"""Links of the wrist, in reach of objects, as the links of an end effector are."""


def lean(spec: mujoco.MjSpec, scene: SceneParams) -> tuple[mujoco.MjModel, Vector]:
    """Return the lean model of `spec`, and the matrix from its `qpos` to the `qpos` of the whole model."""
    whole = spec.compile()
    follows = {
        f"{arm}/{link.name}": Follow(f"{arm}/{link.follow.joint}", link.follow.ratio)
        for arm, params in scene.arms.items()
        for link in links(arm, params)
        if link.follow is not None
    }
    for name in follows:
        tie = spec.equality(name)
        assert tie is not None
        spec.delete(tie)
        spec.delete(spec.joint(name))
    touching = {
        f"{arm}/{link}"
        for arm, params in scene.arms.items()
        for link in (*_WRIST, *(link.name for link in params.end_effector_links))
    }
    for geom in list(spec.geoms):
        is_cover = geom.type == mujoco.mjtGeom.mjGEOM_MESH and not geom.contype
        if is_cover and geom.parent.name not in touching:
            spec.delete(geom)
    model = spec.compile()
    _carry(whole, model, scene, follows)
    return model, _positions(whole, model, follows)


def _carry(
    whole: mujoco.MjModel, model: mujoco.MjModel, scene: SceneParams, follows: Mapping[str, Follow]
) -> None:
    """Give leading joints the inertia of their following links."""
    inertias: list[Vector] = []
    for one in (whole, model):
        data, inertia = mujoco.MjData(one), np.zeros((one.nv, one.nv))
        place(one, data, scene.arms)
        mujoco.mj_forward(one, data)
        mujoco.mj_fullM(one, data, inertia)
        inertias.append(inertia)
    for leader in {follow.joint for follow in follows.values()}:
        velocity = np.zeros(whole.nv)
        velocity[_degree_of_freedom(whole, leader)] = 1.0
        for name, follow in follows.items():
            if follow.joint == leader:
                velocity[_degree_of_freedom(whole, name)] = follow.ratio
        dof = _degree_of_freedom(model, leader)
        model.dof_armature[dof] += velocity @ inertias[0] @ velocity - inertias[1][dof, dof]
    mujoco.mj_setConst(model, mujoco.MjData(model))


def _degree_of_freedom(model: mujoco.MjModel, joint: str) -> int:
    return int(model.joint(joint).dofadr[0])


def _positions(whole: mujoco.MjModel, model: mujoco.MjModel, follows: Mapping[str, Follow]) -> Vector:
    """Return the matrix from positions of `model` to positions of `whole`, shape (whole.nq, model.nq)."""
    matrix = np.zeros((whole.nq, model.nq))
    for i in range(whole.njnt):
        joint = whole.joint(i)  # its size is that of `qpos0`: 7 of a free one
        follow = follows.get(joint.name, Follow(joint.name, 1.0))
        leader = model.joint(follow.joint)
        for k in range(len(joint.qpos0)):
            matrix[int(joint.qposadr[0]) + k, int(leader.qposadr[0]) + k] = follow.ratio
    return matrix
