"""How the independent joints of an arm lead all joints of the model."""

from __future__ import annotations

import mujoco
import numpy as np

from engines.mujoco.model.tree import links
from robots.dvrk.mounted.mounted_arms import AnyArm
from robots.dvrk.setup_joints import DrivenArm
from schemas.vectors import Vector

__all__ = ["to_all_joints"]


def to_all_joints(model: mujoco.MjModel, arm: DrivenArm, params: AnyArm) -> Vector:
    """Return the matrix from velocities of the n joints of `arm` to velocities of all joints, shape (nv, n).

    The linkage moves with the leading joints; the fingers of a jaw are held. The transpose maps loads of all
    joints to loads of the arm's joints.
    """
    joints = [joint.name for joint in params.chain.joints]
    result = np.zeros((model.nv, len(joints)))
    for link in links(arm, params):
        leader, ratio = (link.follow.joint, link.follow.ratio) if link.follow else (link.name, 1.0)
        if leader in joints:
            result[int(model.joint(f"{arm}/{link.name}").dofadr[0]), joints.index(leader)] = ratio
    return result
