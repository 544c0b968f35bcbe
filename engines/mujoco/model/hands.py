"""A hand in the model: a body placed from outside, and six actuators from it to a master's gripper."""

from __future__ import annotations

import mujoco
import numpy as np

from robots.dvrk.mounted.mounted_mtm import MountedMtm

__all__ = ["ACTUATORS", "add", "hand_name"]

ACTUATORS = ("x", "y", "z", "rx", "ry", "rz")
"""Last part of the actuators' names: forces along, and torques about, the axes of the hand."""
_HIDDEN = 4
"""A group hidden in MuJoCo's viewer by default."""


def hand_name(arm: str) -> str:
    """Return the name of the body of the hand on a master."""
    return f"{arm}/hand"


def add(spec: mujoco.MjSpec, arm: str, params: MountedMtm) -> None:
    """Add the hand on the master called `arm`, let go."""
    name, hand = hand_name(arm), params.hand
    body = spec.worldbody.add_body(name=name, mocap=True)
    body.add_site(name=name, group=_HIDDEN)
    inputs = mujoco.mjtCtrlInput
    for way, axis in zip(ACTUATORS, np.eye(6).tolist(), strict=True):
        turns = way.startswith("r")
        actuator = spec.add_actuator(
            name=f"{name}/{way}",
            target=f"{arm}/tip",
            refsite=name,
            trntype=mujoco.mjtTrn.mjTRN_SITE,
            gear=axis,
        )
        actuator.set_to_pid(
            kp=hand.turn_stiffness if turns else hand.stiffness,
            kv=hand.turn_damping if turns else hand.damping,
            ctrlspec=int(inputs.mjINPUT_POS | inputs.mjINPUT_VEL),
        )
