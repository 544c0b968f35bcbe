"""Ray casting by MuJoCo's physics, beside which truth is judged."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from engines.mujoco.truth.sight import Viewpoint
from schemas.vectors import Vector

__all__ = ["Cast", "cast_geoms", "cast_mesh"]

_cast: Callable[..., float] = mujoco.mj_ray  # pyright: ignore
_GROUPS = np.array([1, 1, 1, 0, 0, 0], np.uint8)


class Cast(NamedTuple):
    """What rays meet first."""

    depth: Vector
    """Distance along the optical axis, m; inf: nothing."""
    body: NDArray[np.int64]
    """Body of the model; -1: nothing."""


def cast_geoms(model: mujoco.MjModel, data: mujoco.MjData, view: Viewpoint, rays: Vector) -> Cast:
    """Cast rays, shape (n, 3), at the drawn geoms of a model."""
    length = np.linalg.norm(rays, axis=1)
    directions = (rays / length[:, None]) @ view.pose[:3, :3].T
    depth, body = np.full(len(rays), np.inf), np.full(len(rays), -1)
    start, geom = view.pose[:3, 3].copy(), np.full(1, -1, np.int32)
    # one by one: mj_multiRay of MuJoCo 4.0 leaves out some geoms beside its start
    for i, direction in enumerate(directions):
        distance = _cast(model, data, start, direction, _GROUPS, True, -1, geom, None)
        if distance >= 0.0:
            depth[i], body[i] = distance / length[i], model.geom_bodyid[geom[0]]
    return Cast(depth, body)


def cast_mesh(corners: Vector, rays: Vector) -> Vector:
    """Return the depth, shape (n,), m, at which rays, shape (n, 3), meet triangles, shape (f, 3, 3).

    Both in the optical frame; inf: nothing. Möller and Trumbore's test, one ray after the other.
    """
    a = corners[:, 0]
    ab, ac = corners[:, 1] - a, corners[:, 2] - a
    found = np.full(len(rays), np.inf)
    for i, ray in enumerate(rays):
        across = np.cross(ray, ac)
        volume = np.einsum("ij,ij->i", ab, across)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = -np.einsum("ij,ij->i", a, across) / volume
            turned = np.cross(-a, ab)
            v = turned @ ray / volume
            depth = np.einsum("ij,ij->i", ac, turned) / volume
        met = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (depth > 0.0)
        if met.any():
            found[i] = depth[met].min()
    return found
