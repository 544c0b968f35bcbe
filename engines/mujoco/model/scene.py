"""A whole scene: arms, free or on the cart's setup joints, a console, a table, fixtures and objects."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np

from engines.mujoco.model import arm, console, fixtures, hands, objects, setup_joints, shapes
from engines.mujoco.model.names import PARKED_M, SEAT
from engines.mujoco.model.tree import links, spare_links
from engines.mujoco.params import SceneParams
from robots.dvrk.mounted.mounted_arm import MountedArm
from robots.dvrk.mounted.mounted_arms import AnyArm
from robots.dvrk.mounted.mounted_mtm import MountedMtm
from robots.dvrk.mounted.mounted_psm import MountedPsm
from robots.dvrk.setup_joints import DrivenArm
from schemas.vectors import Vector

__all__ = ["build", "place", "spec"]

_TIMESTEP = 5e-4
"""s; the default of `MujocoParams`."""


def build(scene: SceneParams, timestep: float = _TIMESTEP) -> mujoco.MjModel:
    """Return the compiled model of `scene`, to be stepped by `timestep` seconds."""
    result = spec(scene)
    result.option.timestep = timestep
    return result.compile()


def spec(scene: SceneParams) -> mujoco.MjSpec:
    """Return the uncompiled model of `scene`, for export or additions."""
    result = mujoco.MjSpec()
    result.modelname = scene.model
    result.compiler.degree = False
    result.option.timestep = _TIMESTEP
    _set_options(result.option, grasping=bool(scene.objects) or any(map(_has_springs, scene.arms.values())))
    result.worldbody.add_light(pos=[0.0, 0.0, 3.0], type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL)
    mounts: dict[DrivenArm, Vector] = {}
    if scene.mounting == "cart":
        mounts |= setup_joints.add(result, scene)
    console.add(result, scene)
    for name, params in scene.arms.items():
        pose, seen = mounts.get(name, params.pose), scene.looks != "none"
        bodies = arm.add(result, name, params, pose)
        shapes.add_arm(result, name, params, bodies, seen=seen)
        if isinstance(params, MountedMtm):
            hands.add(result, name, params)
        for owner, spare in params.by_owner(name).items():
            if owner != name and isinstance(spare, MountedPsm):
                own = arm.add_spare(result, name, owner, spare, bodies)
                shapes.add_instrument(result, owner, spare, own, seen=seen)
    if scene.table is not None:
        objects.add_table(result, scene.table)
    for name, fixture in scene.fixtures.items():
        fixtures.add(result, name, fixture)
    for name, thing in scene.objects.items():
        objects.add(result, name, thing, scene.seed)
    return result


def place(model: mujoco.MjModel, data: mujoco.MjData, arms: Mapping[DrivenArm, AnyArm]) -> None:
    """Put the joints of `arms`, with fingers and, unless the model is lean, linkages, at the start."""
    for name, params in arms.items():
        start = _start(params) | {SEAT: 0.0}
        for link in links(name, params):
            q = link.follow.ratio * start[link.follow.joint] if link.follow else start[link.name]
            _put(model, data, f"{name}/{link.name}", q)
        _, *spares = params.by_owner(name).items()
        for owner, spare in spares:
            start = _start(spare) | {SEAT: -PARKED_M}
            for link in spare_links(name, spare):
                _put(model, data, f"{owner}/{link.name}", start[link.name])


def _start(params: AnyArm) -> dict[str, float]:
    """Return the positions at time 0 by joint, of an end effector by link."""
    start = dict(zip((joint.name for joint in params.chain.joints), params.start, strict=True))
    return start | dict(params.end_effector.positions(np.array(params.end_effector_start)))


def _put(model: mujoco.MjModel, data: mujoco.MjData, name: str, position: float) -> None:
    """Set a joint, if the model has one of this name."""
    joint = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name)
    if joint >= 0:
        data.qpos[int(model.jnt_qposadr[joint])] = position


def _set_options(option: mujoco.MjOption, *, grasping: bool) -> None:
    """Choose integrator and friction cone.

    `grasping`: there are objects or fingers on tendons, so friction must hold objects, and light fingers must
    rest at their stops. See docs/decisions/0012 and 0018.
    """
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    if grasping:
        option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
        option.cone, option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 1000.0
        # both cost more than they save here
        option.disableflags = int(mujoco.mjtDisableBit.mjDSBL_ISLAND | mujoco.mjtDisableBit.mjDSBL_MIDPHASE)


def _has_springs(params: MountedArm) -> bool:
    return any(link.spring is not None for link in params.end_effector_links)
