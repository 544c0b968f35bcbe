"""The patient cart and its setup joints: braked, so bodies that stand still where they are set."""

from __future__ import annotations

import mujoco
import numpy as np

from engines.mujoco.model import transform
from engines.mujoco.params import SceneParams
from robots.dvrk import setup_joints
from schemas.vectors import Vector

__all__ = ["CART", "add"]

CART = "cart"
"""The body of the cart; its frame, which is the world's, is the one in which the setup joints are told."""


def add(spec: mujoco.MjSpec, scene: SceneParams) -> dict[str, Vector]:
    """Add the cart and the setup joint of every arm in `scene`; return the poses of the arms' base frames in the cart's, shape (4, 4)."""
    cart = spec.worldbody.add_body(name=CART)
    mounts: dict[str, Vector] = {}
    for arm in scene.arms:
        q = np.array(scene.setup_joints.get(arm, setup_joints.SIMULATED[arm]))
        *links, mounts[arm] = setup_joints.chain(arm).frames(q)
        body, above = cart, np.eye(4)
        for joint, pose in zip(setup_joints.JOINT_NAMES, links, strict=True):
            body = body.add_body(name=f"SUJ/{arm}/{joint}", **transform.placed(transform.inverse(above) @ pose))
            above = pose
    return mounts
