"""The surgeon's console, a fixed body for the eye, where there are masters."""

from __future__ import annotations

import mujoco
import numpy as np

from engines.mujoco.model import shapes
from engines.mujoco.model.poses import pose_attributes
from engines.mujoco.params import SceneParams
from robots.dvrk.mounted.mounted_mtm import MountedMtm
from robots.dvrk.mtm import BASE

__all__ = ["CONSOLE", "add"]

CONSOLE = "console"
"""The body of the console; the frame stands between the bases of both masters."""


def add(spec: mujoco.MjSpec, scene: SceneParams) -> None:
    """Add the console of the first master, if there is one."""
    master = next((arm for arm in scene.arms.values() if isinstance(arm, MountedMtm)), None)
    if master is None:
        return
    pose = master.viewer_pose @ (0.5 * (BASE["MTML"] + BASE["MTMR"]))
    body = spec.worldbody.add_body(name=CONSOLE, **pose_attributes(pose))
    shapes.add(spec, CONSOLE, CONSOLE, {CONSOLE: (body, np.eye(4))}, seen=scene.looks != "none")
