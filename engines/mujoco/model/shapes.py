"""What an arm looks like and what of it collides."""

from __future__ import annotations

import mujoco
import numpy as np

from engines.mujoco.model.arm import Bodies
from engines.mujoco.params import EcmParams, PsmParams

_UNSEEN_BY_PHYSICS = {"mass": 0.0, "contype": 0, "conaffinity": 0}


def add(spec, arm, params: PsmParams | EcmParams, bodies: Bodies) -> None:
    """Interim: draw each link as a capsule to the next."""
    for name, (body, pose) in bodies.items():
        if name == "base":
            continue
        children = [other for other in bodies.values() if other[0].parent.name == body.name] if body.parent else []
        for _child, child_pose in children:
            end = pose[:3, :3].T @ (child_pose[:3, 3] - pose[:3, 3])
            if np.linalg.norm(end) > 1e-3:
                body.add_geom(type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=[0.004, 0.0, 0.0], fromto=[0.0, 0.0, 0.0, *end.tolist()], **_UNSEEN_BY_PHYSICS)
