"""An arm of the model: bodies and joints, masses, servos, ties, sites and sensors."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from engines.mujoco.model import end_effector as end_effectors
from engines.mujoco.model.names import SEAT, sphere_site
from engines.mujoco.model.poses import pose_attributes
from engines.mujoco.model.rigid import tie
from engines.mujoco.model.sensors import add_arm_sensors, add_sphere_sensors
from engines.mujoco.model.servo import add_joint_drive
from engines.mujoco.model.shapes import Bodies
from engines.mujoco.model.tree import BASE, links, spare_links
from robots.dvrk.drive import Disc
from robots.dvrk.end_effectors.contact_sphere import ContactSphere
from robots.dvrk.link import Link
from robots.dvrk.mounted.mounted_arm import MountedArm
from robots.dvrk.setup_joints import DrivenArm
from robots.transform import inverse_transform
from schemas.vectors import Vector

__all__ = ["add", "add_spare"]

_HIDDEN = 4
"""A group hidden in MuJoCo's viewer by default."""
_SEAT_ARMATURE = 1e4
"""Inertia of a seat, kg: 10 N move it by 1 nm in a step, and `Exchange.hold` moves it back. With 1e6 kg the
constraint solver loses digits of the other joints.
"""
_SEAT_MASS, _SEAT_INERTIA = 1e-9, 1e-12
"""kg and kg m^2; MuJoCo wants some."""


def add(spec: mujoco.MjSpec, name: DrivenArm, params: MountedArm, base_pose: Vector) -> Bodies:
    """Add the arm called `name`, and return the bodies by link.

    `base_pose`: pose of the base frame in the world, shape (4, 4).
    """
    base = spec.worldbody.add_body(name=f"{name}/{BASE}", **pose_attributes(base_pose))
    base.add_site(name=f"{name}/base", group=_HIDDEN)
    bodies = {BASE: (base, np.eye(4))}
    for link in links(name, params):
        above, above_pose = bodies[link.parent]
        body = above.add_body(
            name=f"{name}/{link.name}",
            gravcomp=1.0,
            **pose_attributes(inverse_transform(above_pose) @ link.pose),
        )
        bodies[link.name] = body, link.pose
        _add_joint(spec, body, name, link)
    if SEAT in bodies:
        _make_seat(spec, bodies[SEAT][0], f"{name}/{SEAT}")
    chain, effector, moved = params.chain, params.end_effector, params.end_effector_links
    for joint in chain.joints:
        add_joint_drive(spec, f"{name}/{joint.name}", f"{name}/{joint.name}", params.drives[joint.name])
    end_effectors.add_motors(spec, name, effector, moved, params.drives)
    _add_discs(spec, name, params.discs)
    _set_inertias(bodies, params)
    bodies[chain.joints[-1].name][0].add_site(name=f"{name}/tip", group=_HIDDEN, **pose_attributes(chain.tip))
    add_arm_sensors(spec, name, [joint.name for joint in chain.joints])
    end_effectors.add_sensors(spec, name, effector, moved)
    _add_spheres(spec, name, params.spheres, bodies)
    return bodies


def add_spare(spec: mujoco.MjSpec, arm: DrivenArm, owner: str, spare: MountedArm, bodies: Bodies) -> Bodies:
    """Add a spare instrument to the arm called `arm`, with `bodies`, and return its own bodies by link.

    `owner`: prefix of the names of its parts.
    """
    own: dict[str, tuple[mujoco.MjsBody, Vector]] = {}
    for link in spare_links(arm, spare):
        above, above_pose = own.get(link.parent) or bodies[link.parent]
        body = above.add_body(
            name=f"{owner}/{link.name}",
            gravcomp=1.0,
            **pose_attributes(inverse_transform(above_pose) @ link.pose),
        )
        own[link.name] = body, link.pose
        _add_joint(spec, body, owner, link)
    _make_seat(spec, own[SEAT][0], f"{owner}/{SEAT}")
    for joint in spare.chain.joints:
        if joint.name in own:
            add_joint_drive(spec, f"{owner}/{joint.name}", f"{owner}/{joint.name}", spare.drives[joint.name])
    effector, moved = spare.end_effector, spare.end_effector_links
    end_effectors.add_motors(spec, owner, effector, moved, spare.drives)
    _add_discs(spec, owner, spare.discs)
    _set_inertias(own, spare)
    tip = pose_attributes(spare.chain.tip)
    own[spare.chain.joints[-1].name][0].add_site(name=f"{owner}/tip", group=_HIDDEN, **tip)
    end_effectors.add_sensors(spec, owner, effector, moved)
    _add_spheres(spec, owner, spare.spheres, own)
    return own


def _make_seat(spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str) -> None:
    body.mass, body.explicitinertial = _SEAT_MASS, True
    body.inertia = [_SEAT_INERTIA] * 3
    spec.joint(name).armature = _SEAT_ARMATURE


def _add_joint(spec: mujoco.MjSpec, body: mujoco.MjsBody, arm: str, link: Link) -> None:
    name = f"{arm}/{link.name}"
    kind = mujoco.mjtJoint.mjJNT_HINGE if link.kind == "revolute" else mujoco.mjtJoint.mjJNT_SLIDE
    body.add_joint(
        name=name,
        type=kind,
        axis=[0.0, 0.0, 1.0],
        limited=link.follow is None,
        range=[link.lower, link.upper],
    )
    if link.follow is not None:
        tie(spec, name, name, f"{arm}/{link.follow.joint}", link.follow.ratio)


def _add_discs(spec: mujoco.MjSpec, arm: str, discs: Sequence[Disc]) -> None:
    """Add the friction of an instrument's discs: a disc turns with several joints."""
    for i, disc in enumerate(discs, 1):
        tendon = spec.add_tendon(
            name=f"{arm}/disc_{i}",
            damping=[disc.viscous_friction, 0.0, 0.0],
            frictionloss=disc.coulomb_friction,
        )
        for name, share in disc.shares.items():
            tendon.wrap_joint(f"{arm}/{name}", share)


def _set_inertias(bodies: Bodies, params: MountedArm) -> None:
    """Set the inertia of each body from the base frame with every joint at 0."""
    for link, given in params.bodies.items():
        if link not in bodies:  # a spare instrument has its own links alone
            continue
        body, pose = bodies[link]
        turn = pose[:3, :3]
        tensor = turn.T @ given.tensor @ turn
        body.mass, body.explicitinertial = given.mass, True
        body.ipos = (turn.T @ (given.centre - pose[:3, 3])).tolist()
        body.fullinertia = [
            tensor[0, 0],
            tensor[1, 1],
            tensor[2, 2],
            tensor[0, 1],
            tensor[0, 2],
            tensor[1, 2],
        ]


def _add_spheres(spec: mujoco.MjSpec, arm: str, spheres: Sequence[ContactSphere], bodies: Bodies) -> None:
    """Mark the contact spheres by sites, with sensors."""
    for sphere in spheres:
        bodies[sphere.link][0].add_site(
            name=sphere_site(arm, sphere.name),
            pos=sphere.position,
            size=[sphere.radius, 0.0, 0.0],
            group=_HIDDEN,
        )
    add_sphere_sensors(spec, arm, spheres)
