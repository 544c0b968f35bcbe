"""Constraints on joints: ties between the fingers of a jaw, and the brakes of the ECM."""

from __future__ import annotations

import mujoco

from engines.mujoco.model.end_effector import add_ties
from engines.mujoco.model.rigid import RIGID
from engines.mujoco.params import SceneParams

__all__ = ["BRAKED", "add", "brake", "set_brake"]

BRAKED = "ECM"
"""The arm with brakes."""


def brake(joint: str) -> str:
    """Return the name of the brake of `joint` of the ECM, an equality; the first number is the position."""
    return f"{BRAKED}/{joint}/brake"


def set_brake(spec: mujoco.MjSpec, joint: str, position: float) -> None:
    """Let the brake of `joint`, from `add`, close at `position` (rad, m)."""
    if (equality := spec.equality(brake(joint))) is not None:
        equality.data[0] = position


def add(spec: mujoco.MjSpec, scene: SceneParams) -> None:
    """Add the brakes, open, and the ties of end effectors to the model of `scene`."""
    joints = {"type": mujoco.mjtEq.mjEQ_JOINT, "objtype": mujoco.mjtObj.mjOBJ_JOINT}
    if BRAKED in scene.arms:
        for joint in scene.arms[BRAKED].chain.joints:
            name = f"{BRAKED}/{joint.name}"
            spec.add_equality(name=brake(joint.name), name1=name, active=False, **joints, **RIGID)
    for arm, params in scene.arms.items():
        for owner, variant in params.by_owner(arm).items():
            add_ties(spec, owner, variant.end_effector)
