"""The equations of motion of an arm: M(q) a + gravity(q) + elastic(q) + friction(v) = effort.

Coordinates are the independent joints. The linkage, and the closed fingers, move with their leading joints:
with v = G u, from the velocities u of the independent joints to the velocities v of all joints, the inertia
is G' M G and a load G' f.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import mujoco
import numpy as np

from engines.mujoco.model.leading import to_all_joints
from engines.mujoco.model.scene import build
from engines.mujoco.params import SceneParams
from robots.dvrk import drives
from robots.dvrk.setup_joints import CartArm
from schemas.files import Files
from schemas.plain_sum import plain_sum
from schemas.vectors import Vector

__all__ = ["UPRIGHT", "JointDynamics", "dynamics"]

UPRIGHT: Mapping[str, Any] = MappingProxyType({"mounting": "free"})
"""The base frame stands as the world's does."""


@dataclass(frozen=True)
class JointDynamics:
    """Dynamics at a configuration; rad, m, N m, N, by joint in the order of `joints`."""

    joints: tuple[str, ...]
    base: Vector
    """Rotation from the arm's base frame to the world (z up), shape (3, 3)."""
    inertia: Vector
    """Joint-space inertia matrix, shape (n, n)."""
    gravity: Vector
    """Holding effort against gravity, with the base as given, shape (n,)."""
    viscous_friction: Vector
    """Effort per velocity of a joint moving alone, shape (n,); the discs of an instrument couple wrist and
    jaw, see `friction`.
    """
    coulomb_friction: Vector
    """Effort of a joint moving alone, shape (n,)."""
    friction: Vector
    """Effort against friction at the velocities asked for, shape (n,)."""
    elastic_stiffness: Vector
    """Shape (n,)."""
    elastic: Vector
    """Holding effort against the springs, shape (n,)."""


def dynamics(
    arm: CartArm,
    tool: str,
    q: Sequence[float],
    dq: Sequence[float],
    own: Path | None = None,
    *,
    base: Mapping[str, Any] = UPRIGHT,
) -> JointDynamics:
    """Return the dynamics of `arm`, alone on its base.

    Args:
        arm: PSM1, PSM2, PSM3 or ECM.
        tool: instrument of a PSM, by name or number; endoscope of the ECM.
        q: joint positions (rad, m), one per joint, in range.
        dq: joint velocities (rad/s, m/s), one per joint.
        own: file of `trocar identify` of a PSM; the published dynamics unless given.
        base: how the base stands, in the words of a scene: `mounting`, and either `orientation` (quaternion
            x, y, z, w of the base frame in the world) or `setup_joints` (m, rad, six numbers).

    Raises ValidationError if `own` cannot be read or does not fit the arm, or if `base` is no way to stand.
    """
    scene = _scene_of(arm, tool, own, base)
    params = scene.arms[arm]
    model = build(scene)
    data = mujoco.MjData(model)
    joints = [joint.name for joint in params.chain.joints]
    to_all = to_all_joints(model, arm, params)
    data.qpos[:] = to_all @ q
    mujoco.mj_forward(model, data)
    inertia = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, inertia)
    driven, wrist = params.drives, params.discs
    at_rest = dict.fromkeys(driven, 0.0)
    moving = drives.friction(driven, {**at_rest, **dict(zip(joints, dq, strict=True))}, wrist)
    alone = [
        [
            getattr(driven[name], kind)
            + plain_sum(getattr(disc, kind) * abs(disc.shares.get(name, 0.0)) ** power for disc in wrist)
            for name in joints
        ]
        for kind, power in (("viscous_friction", 2), ("coulomb_friction", 1))
    ]
    return JointDynamics(
        joints=tuple(joints),
        base=data.site_xmat[model.site(f"{arm}/base").id].reshape(3, 3).copy(),
        inertia=to_all.T @ inertia @ to_all,
        gravity=to_all.T @ data.qfrc_bias,
        viscous_friction=np.array(alone[0]),
        coulomb_friction=np.array(alone[1]),
        friction=np.array([moving[name] for name in joints]),
        elastic_stiffness=to_all.T @ model.jnt_stiffness,
        elastic=to_all.T @ (model.jnt_stiffness * (data.qpos - model.qpos_spring)),
    )


def _scene_of(arm: CartArm, tool: str, own: Path | None, base: Mapping[str, Any]) -> SceneParams:
    """Return a scene of `arm` alone."""
    stand = dict(base)
    what: dict[str, Any] = {"endoscope" if arm == "ECM" else "instrument": tool}
    if "orientation" in stand:
        what["orientation"] = stand.pop("orientation")
    if "setup_joints" in stand:
        stand["setup_joints"] = {arm: stand["setup_joints"]}
    if own is not None:
        what["dynamics"] = own
    return SceneParams.model_validate(
        {"arms": {arm: what}, "looks": "none", **stand}, context=Files(Path.cwd()).context
    )
