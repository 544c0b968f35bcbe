"""Collision shapes: convex hulls of covers, capsules for shafts, boxes for fingers.

Covers belong to arms, setup joints and cart.
"""

from __future__ import annotations

import numpy as np

from engines.mujoco.looks import cart as cart_look
from engines.mujoco.looks import ecm as ecm_look
from engines.mujoco.looks import end_effectors, instruments
from engines.mujoco.looks import psm as psm_look
from engines.mujoco.looks import setup_joints as setup_look
from engines.mujoco.looks.part import Collisions, Looks, Part, Primitive
from engines.mujoco.looks.solids import hull
from robots.dvrk import psm as psm_arm
from robots.dvrk.end_effectors.end_effector import Mount
from robots.dvrk.instruments import SHAFT_RADIUS, WRIST_RADIUS, Instrument
from robots.dvrk.setup_joints import CartArm
from robots.transform import translation

__all__ = ["cart", "ecm", "instrument", "psm", "setup_joint"]

_ECM_SHAFT_RADIUS = 0.006
_THIN = ("cannula", "endoscope_shaft")
"""Thin parts, left out of a link's hull."""
_BULK = ("column", "housing", "deck")
"""Enclosing parts of the cart, each with a separate hull."""


def cart() -> Collisions:
    """Return the collision shapes of the cart."""
    return {
        body: tuple(_convex_hull(p.name, (p,)) for p in shown if p.name in _BULK)
        for body, shown in cart_look.parts().items()
    }


def setup_joint(arm: CartArm) -> Collisions:
    """Return the collision shapes of the setup joint under `arm`."""
    return {body: (_convex_hull(body, shown),) for body, shown in setup_look.parts(arm).items() if shown}


def psm() -> Collisions:
    """Return the collision shapes of a PSM without instrument."""
    return {body: (_convex_hull(body, shown),) for body, shown in psm_look.parts().items()}


def ecm() -> Collisions:
    """Return the collision shapes of an ECM with endoscope."""
    hulls: dict[str, tuple[Part | Primitive, ...]] = {
        body: (_convex_hull(body, shown),) for body, shown in ecm_look.parts().items()
    }
    shaft = next(p for p in ecm_look.parts()["roll"] if p.name == "endoscope_shaft").vertices[:, 2]
    hulls["roll"] += (_upright("shaft", _ECM_SHAFT_RADIUS, float(shaft.min()), float(shaft.max())),)
    return hulls


def instrument(tool: Instrument) -> Collisions:
    """Return the collision shapes of an instrument in a PSM: housing, shaft, wrist, and end effector."""
    looks: Looks = instruments.parts(tool)
    chain = psm_arm.chain(tool)
    shaft = looks["roll"][0].vertices[:, 2]
    collisions: dict[str, tuple[Part | Primitive, ...]] = {
        "insertion": (_convex_hull("housing", looks["insertion"]),)
    }
    if tool.has_wrist:
        frames = chain.frames(np.zeros(len(chain.joints)))
        pitch, yaw = frames[4][2, 3], frames[-2][2, 3]
        wrist, last = tool.joints[1].name, tool.joints[-1].name
        collisions["roll"] = (_upright("shaft", SHAFT_RADIUS, pitch, float(shaft.max())),)
        collisions[wrist] = (_upright("wrist", WRIST_RADIUS, yaw, pitch),)
        collisions[last] = (_convex_hull(last, looks[last]),)
    else:
        collisions["roll"] = (_upright("shaft", SHAFT_RADIUS, float(shaft.min()), float(shaft.max())),)
    return {**collisions, **end_effectors.collision(tool.end_effector, tool.name, Mount.on(chain))}


def _convex_hull(name: str, shown: tuple[Part, ...]) -> Part:
    points = np.concatenate([p.vertices for p in shown if p.name not in _THIN])
    return hull(f"{name}_hull", points, shown[0].material)


def _upright(name: str, radius: float, low: float, high: float) -> Primitive:
    """Return a capsule along the z axis between two heights."""
    pose = translation(0.0, 0.0, (low + high) / 2.0)
    return Primitive(name, "capsule", (radius, max((high - low) / 2.0 - radius, radius)), pose)
