"""The keyframe of an exported model: whoever loads it need not begin with instruments drawn back and servos
that pull them there.
"""

from __future__ import annotations

import mujoco

from engines.mujoco.params import SceneParams
from engines.mujoco.readings import place

__all__ = ["START", "add_start"]

START = "start"


def add_start(spec: mujoco.MjSpec, scene: SceneParams) -> None:
    """Add the keyframe `START` to the model of `scene`: joints where the scene starts, and servos told to
    hold them there.
    """
    model = spec.compile()
    data = mujoco.MjData(model)
    place(model, data, scene.arms)
    for actuator, (joint, _) in enumerate(model.actuator_trnid):
        data.ctrl[model.actuator_ctrladr[actuator]] = data.qpos[model.jnt_qposadr[joint]]
    spec.add_key(name=START, qpos=data.qpos, ctrl=data.ctrl)
