"""Looks and collision shapes of arms, setup joints and cart.

Looks and collision shapes come from `engines.mujoco.looks`, drawn in an arm's base frame (or the cart's) with
every joint at 0, and are carried to the bodies here. Cart, setup joints and every link of the arms collide
with objects, links also with the table; shaft, wrist and fingers also with the same parts of other arms.
Covers of two arms pass through each other, as they do in the dVRK's own simulated setup (PSM2 and PSM3 stand
in one another there), and no arm collides with itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import get_args

import mujoco
import numpy as np

from engines.mujoco import looks
from engines.mujoco.model.names import SEAT
from engines.mujoco.model.poses import pose_attributes
from robots.dvrk.end_effectors.probe import Probe
from robots.dvrk.instruments import Instrument
from robots.dvrk.mounted.mounted_arms import AnyArm
from robots.dvrk.mounted.mounted_ecm import MountedEcm
from robots.dvrk.mounted.mounted_mtm import MountedMtm
from robots.dvrk.mounted.mounted_psm import MountedPsm
from robots.dvrk.setup_joints import CartArm, DrivenArm
from robots.transform import inverse_transform
from schemas.vectors import Vector

__all__ = ["Bodies", "add", "add_arm", "add_instrument"]

Bodies = Mapping[str, tuple[mujoco.MjsBody, Vector]]
"""Body by link, and the body's pose, shape (4, 4), in the frame of the look, with every joint at 0."""

_SEEN, _COLLIDING = 1, 3
"""Groups of geoms; MuJoCo's viewer hides the latter unless asked."""
_THINGS = 1
"""Collision bit of table and objects: MuJoCo's default."""
_BIT: Mapping[str, int] = {arm: 2 << i for i, arm in enumerate(get_args(CartArm))}
"""Collision bit of each arm's instrument."""
_KINDS = {"box": mujoco.mjtGeom.mjGEOM_BOX, "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE}
_UNSEEN_BY_PHYSICS = {"contype": 0, "conaffinity": 0, "mass": 0.0, "group": _SEEN}


def add_arm(spec: mujoco.MjSpec, arm: DrivenArm, params: AnyArm, bodies: Bodies, *, seen: bool) -> None:
    """Give an arm and the instrument collision shapes and, if `seen`, looks."""
    look = "ecm" if isinstance(params, MountedEcm) else "mtm" if isinstance(params, MountedMtm) else "psm"
    add(spec, look, arm, bodies, seen=seen)
    if isinstance(params, MountedPsm):
        add_instrument(spec, arm, params, bodies, seen=seen)
    if isinstance(params.end_effector, Probe):
        body, _ = bodies[params.chain.joints[-1].name]
        body.add_geom(
            name=f"{arm}/probe",
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[params.end_effector.radius, 0.0, 0.0],
            mass=0.0,
            group=_SEEN,
            **_instrument(arm),
        )


def add_instrument(
    spec: mujoco.MjSpec, owner: str, params: MountedPsm, bodies: Bodies, *, seen: bool
) -> None:
    """Give an instrument collision shapes and, if `seen`, looks.

    `owner`: prefix of the names of the bodies. On a seat the housing goes with the instrument.
    """
    seat = {"insertion": bodies[SEAT]} if SEAT in bodies else {}
    add(spec, _look(params), owner, {**bodies, **seat}, seen=seen)


def _look(params: MountedPsm) -> str | Instrument:
    return f"instrument/{params.tool.name}" if params.tip is None else params.tool


def add(spec: mujoco.MjSpec, what: str | Instrument, owner: str, bodies: Bodies, *, seen: bool) -> None:
    """Give the bodies of `owner` collision shapes and, if `seen`, looks.

    `what`: a name known to `looks.parts`, or an instrument of the user's own.
    """
    if seen:
        _add_looks(spec, what, owner, bodies)
    _add_collision(spec, what, owner, bodies, group=_COLLIDING if seen else _SEEN)


def _add_looks(spec: mujoco.MjSpec, what: str | Instrument, owner: str, bodies: Bodies) -> None:
    for link, parts in looks.parts(what).items():
        body, pose = bodies[link]
        for part in parts:
            material = part.material
            if spec.material(material.name) is None:
                spec.add_material(
                    name=material.name,
                    rgba=material.rgba,
                    specular=material.specular,
                    shininess=material.shininess,
                )
            mesh = _mesh(spec, f"{_label(what, owner)}/{part.name}", part, pose)
            body.add_geom(
                type=mujoco.mjtGeom.mjGEOM_MESH, meshname=mesh, material=material.name, **_UNSEEN_BY_PHYSICS
            )


def _add_collision(
    spec: mujoco.MjSpec, what: str | Instrument, owner: str, bodies: Bodies, *, group: int
) -> None:
    for link, shapes in looks.collision(what).items():
        body, pose = bodies[link]
        for shape in shapes:
            common = {"name": f"{owner}/{shape.name}", "mass": 0.0, "group": group}
            if isinstance(shape, looks.Part):
                mesh = _mesh(spec, f"{_label(what, owner)}/{shape.name}", shape, pose)
                body.add_geom(
                    type=mujoco.mjtGeom.mjGEOM_MESH, meshname=mesh, contype=0, conaffinity=_THINGS, **common
                )
            else:
                place = pose_attributes(inverse_transform(pose) @ shape.pose)
                body.add_geom(
                    type=_KINDS[shape.kind],
                    size=[*shape.size, 0.0, 0.0][:3],
                    **place,
                    **common,
                    **_instrument(owner),
                )


def _label(what: str | Instrument, owner: str) -> str:
    """Return the first part of the names of meshes: two arms may hold two instruments of one name."""
    return f"{owner}/{what.name}" if isinstance(what, Instrument) else what


def _instrument(owner: str) -> dict[str, int]:
    """Return the collision filter of shaft, wrist and fingers; `owner`: an arm, or a spare of it."""
    bit = _BIT[owner.partition("/")[0]]
    return {"contype": bit, "conaffinity": _THINGS | sum(_BIT.values()) - bit}


def _mesh(spec: mujoco.MjSpec, name: str, part: looks.Part, pose: Vector) -> str:
    """Add the mesh of `part` in the frame of a body at `pose`, unless there already by another arm."""
    if spec.mesh(name) is None:
        vertices = (part.vertices - pose[:3, 3]) @ pose[:3, :3]
        spec.add_mesh(name=name, uservert=vertices.ravel(), userface=np.asarray(part.faces, np.int32).ravel())
    return name
