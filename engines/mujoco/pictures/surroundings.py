"""The place of a scene: which one, and around what."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np

from engines.mujoco.pictures.endoscope_params import EndoscopeParams
from engines.mujoco.pictures.soft_body import SoftBody
from engines.mujoco.place.abdomen import make_abdomen
from engines.mujoco.place.dry_lab import make_dry_lab
from engines.mujoco.place.part import PlacePart
from engines.mujoco.place.subhepatic import make_subhepatic
from robots.training.threads import THREAD
from schemas.vectors import Vector

__all__ = ["make_place"]

_LIVER = "liver"
_ALONE = 0.03
"""Half the side of the box where nothing lies in a scene, m."""


def make_place(
    params: EndoscopeParams,
    model: mujoco.MjModel,
    bodies: Mapping[str, SoftBody],
    lens: Vector,
    seed: int = 0,
) -> list[PlacePart]:
    """Return the surroundings of a scene.

    Args:
        params: of the cameras.
        model: compiled from the scene.
        bodies: soft bodies at rest.
        lens: where the camera is at the start, shape (3,), m.
        seed: of shapes.
    """
    if params.surroundings == "none":
        return []
    points = [body.rest.astype(np.float64) for name, body in bodies.items() if name != THREAD]
    points += _set_points(params, model)
    cloud = np.concatenate(points) if points else np.array([[-_ALONE] * 3, [_ALONE] * 3])
    if params.surroundings == "subhepatic":
        liver = bodies[_LIVER].rest.astype(np.float64) if _LIVER in bodies else cloud
        return make_subhepatic(liver.min(axis=0), liver.max(axis=0), seed)
    low, high = cloud.min(axis=0), cloud.max(axis=0)
    if params.surroundings == "dry-lab":
        return make_dry_lab(low, high, seed)
    inside = params.view is None and "ECM" in params.arms
    return make_abdomen(low, high, lens if inside else None, seed)


def _set_points(params: EndoscopeParams, model: mujoco.MjModel) -> list[Vector]:
    """Return points of table, fixtures and objects, shape (n, 3) each, m, frame `world`."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    own = {"table", *params.fixtures, *params.objects}
    found: list[Vector] = []
    for geom in range(model.ngeom):
        name = model.body(int(model.geom_bodyid[geom])).name
        if name.partition("/")[0] not in own:
            continue
        reach = np.abs(data.geom_xmat[geom].reshape(3, 3)) @ model.geom_aabb[geom, 3:]
        middle = data.geom_xpos[geom] + data.geom_xmat[geom].reshape(3, 3) @ model.geom_aabb[geom, :3]
        found.append(np.stack([middle - reach, middle + reach]))
    return found
