"""The patient cart and the braked setup joints, as fixed bodies.

Masses have no effect here; exported models use the masses.
"""

from __future__ import annotations

import mujoco
import numpy as np

from engines.mujoco.model import shapes
from engines.mujoco.model.poses import pose_attributes
from engines.mujoco.params import SceneParams
from robots.dvrk import setup_joints
from robots.dvrk.setup_joints import CartArm
from robots.transform import inverse_transform
from schemas.vectors import Vector

__all__ = ["CART", "add"]

CART = "cart"
"""The body of the cart; the frame is the world's, and the frame of the setup joints."""


def add(spec: mujoco.MjSpec, scene: SceneParams) -> dict[CartArm, Vector]:
    """Add the cart and the setup joint of every arm of the cart in `scene`.

    Returns the poses of the arms' base frames in the world, shape (4, 4).
    """
    cart = spec.worldbody.add_body(name=CART)
    shapes.add(spec, CART, CART, {CART: (cart, np.eye(4))}, seen=scene.looks != "none")
    _weigh(cart, setup_joints.CART_MASS)
    mounts: dict[CartArm, Vector] = {}
    for arm in scene.arms:
        if arm == "MTML" or arm == "MTMR":
            continue
        chain = setup_joints.chain(arm)
        *poses, mounts[arm] = chain.frames(np.array(scene.setup_joints.get(arm, setup_joints.SIMULATED[arm])))
        drawn = chain.frames(np.zeros(len(setup_joints.JOINT_NAMES)))
        body, above, bodies = cart, np.eye(4), dict[str, tuple[mujoco.MjsBody, Vector]]()
        for joint, pose, zero in zip(setup_joints.JOINT_NAMES, poses, drawn[:-1], strict=True):
            body = body.add_body(
                name=f"SUJ/{arm}/{joint}", **pose_attributes(inverse_transform(above) @ pose)
            )
            bodies[joint], above = (body, zero), pose
        shapes.add(spec, f"suj/{arm}", f"SUJ/{arm}", bodies, seen=scene.looks != "none")
        for joint, mass in zip(setup_joints.JOINT_NAMES, setup_joints.MASSES[arm], strict=True):
            _weigh(bodies[joint][0], mass)
    return mounts


def _weigh(body: mujoco.MjsBody, mass: float) -> None:
    """Spread `mass` (kg) evenly over the collision shapes of `body`."""
    colliding = [geom for geom in body.geoms if geom.conaffinity]
    for geom in colliding:
        geom.mass = mass / len(colliding)
