"""Objects put somewhere from outside, as a person does between two trials."""

from __future__ import annotations

import mujoco
import numpy as np

from schemas.ros import PoseStamped

__all__ = ["place"]


def place(model: mujoco.MjModel, data: mujoco.MjData, thing: str, message: PoseStamped) -> None:
    """Put `thing` at a pose in the world, at rest, and compute contacts there."""
    joint = model.joint(thing)
    position, turn = message.pose.position, message.pose.orientation
    at, velocity = int(joint.qposadr[0]), int(joint.dofadr[0])
    data.qpos[at : at + 3] = position.x, position.y, position.z
    quaternion = np.array([turn.w, turn.x, turn.y, turn.z])
    data.qpos[at + 3 : at + 7] = quaternion / np.linalg.norm(quaternion)
    data.qvel[velocity : velocity + 6] = 0.0
    mujoco.mj_step1(model, data)
