"""What holds joints: the tie that makes two fingers one jaw, and the brakes of the ECM."""

from __future__ import annotations

import mujoco

from engines.mujoco.model.names import FINGERS
from engines.mujoco.params import SceneParams, has_jaw

__all__ = ["BRAKED", "add", "brake", "set_brake"]

BRAKED = "ECM"
"""The arm whose joints have brakes."""
_RIGID = {"solref": [1e-3, 1.0], "solimp": [0.999, 0.9999, 1e-4, 0.5, 2.0]}


def brake(joint: str) -> str:
    """Return the name of the equality that brakes `joint` of the ECM; its first number is the position."""
    return f"{BRAKED}/{joint}/brake"


def set_brake(spec: mujoco.MjSpec, joint: str, position: float) -> None:
    """Let the brake of `joint`, which `add` has added, close at `position` (rad, m)."""
    if (equality := spec.equality(brake(joint))) is not None:
        equality.data[0] = position


def add(spec: mujoco.MjSpec, scene: SceneParams) -> None:
    """Add the brakes, open, and the ties of the jaws to the model of `scene`.

    With the tie between its fingers a jaw does not give way to one side, however hard it closes.
    """
    joints = {"type": mujoco.mjtEq.mjEQ_JOINT, "objtype": mujoco.mjtObj.mjOBJ_JOINT}
    if BRAKED in scene.arms:
        for joint in scene.arms[BRAKED].chain.joints:
            name = f"{BRAKED}/{joint.name}"
            spec.add_equality(name=brake(joint.name), name1=name, active=False, **joints, **_RIGID)
    for arm, params in scene.arms.items():
        if has_jaw(params):
            left, right = (f"{arm}/{finger}" for finger in FINGERS)
            tie = {"name": f"{arm}/jaw", "name1": left, "name2": right, "data": [0.0, 1.0, *[0.0] * 10]}
            spec.add_equality(**tie, **joints, **_RIGID)
