"""How many joint positions (`qpos`) the model of a scene has, known without building it."""

from __future__ import annotations

from engines.mujoco.params import EcmParams, SceneParams
from robots.dvrk import ecm
from robots.dvrk.linkage import LINKAGES
from robots.dvrk.rolling_needle_driver import PADS

__all__ = ["position_count"]

_FREE_BODY = 7
"""Position and quaternion."""


def position_count(scene: SceneParams) -> int:
    """Return the size of `qpos`: joints, linkage and fingers with pads or phalanges of every arm, then the
    pose of every object.
    """
    count = _FREE_BODY * len(scene.objects)
    for name, arm in scene.arms.items():
        if isinstance(arm, EcmParams):
            count += len(ecm.JOINT_NAMES)
        else:
            tool = arm.tool
            count += (
                len(arm.chain.joints)
                + (0 if tool.jaw is None else 2)
                + (0 if tool.hand is None else len(tool.hand.links))
            )
            count += 0 if tool.roller is None else len(PADS)
        count += len(LINKAGES[name].joints)
    return count
