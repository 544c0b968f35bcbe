"""One arm of the model: its bodies and joints, their masses, servos, ties, sites and sensors."""

from __future__ import annotations

import mujoco
import numpy as np

from engines.mujoco.model import hand as hands
from engines.mujoco.model import roller as rollers
from engines.mujoco.model.names import FINGERS, sphere_site
from engines.mujoco.model.poses import placed
from engines.mujoco.model.shapes import Bodies
from engines.mujoco.model.tree import BASE, Link, links
from robots.dvrk.cart import inverse_pose
from robots.dvrk.contact_spheres import ContactSphere
from robots.dvrk.drives import Drive
from robots.dvrk.mounted import MountedEcm, MountedPsm
from robots.dvrk.rolling_needle_driver import ROLLER
from schemas.vectors import Vector

__all__ = ["add"]

_HIDDEN = 4
"""A group that MuJoCo's viewer does not show unless asked."""
_TIE = {"solref": [1e-3, 1.0], "solimp": [0.999, 0.9999, 1e-4, 0.5, 2.0]}
"""Of the ties of the linkage: a time constant of twice the default sub-step, the shortest that MuJoCo takes,
and all but rigid.
"""
_POSE = ((mujoco.mjtSensor.mjSENS_FRAMEPOS, "position"), (mujoco.mjtSensor.mjSENS_FRAMEQUAT, "quaternion"))
_TWIST = ((mujoco.mjtSensor.mjSENS_FRAMELINVEL, "linear"), (mujoco.mjtSensor.mjSENS_FRAMEANGVEL, "angular"))
_JOINT = (
    (mujoco.mjtSensor.mjSENS_JOINTPOS, "position"),
    (mujoco.mjtSensor.mjSENS_JOINTVEL, "velocity"),
    (mujoco.mjtSensor.mjSENS_JOINTACTFRC, "effort"),
)
_MOTOR = (
    (mujoco.mjtSensor.mjSENS_ACTUATORPOS, "position"),
    (mujoco.mjtSensor.mjSENS_ACTUATORVEL, "velocity"),
    (mujoco.mjtSensor.mjSENS_ACTUATORFRC, "effort"),
)


def add(spec: mujoco.MjSpec, name: str, params: MountedPsm | MountedEcm, base_pose: Vector) -> Bodies:
    """Add the arm called `name`, and return its bodies by link.

    `base_pose`: of its base frame in the world, shape (4, 4).
    """
    base = spec.worldbody.add_body(name=f"{name}/{BASE}", **placed(base_pose))
    base.add_site(name=f"{name}/base", group=_HIDDEN)
    bodies = {BASE: (base, np.eye(4))}
    for link in links(name, params):
        above, above_pose = bodies[link.parent]
        body = above.add_body(
            name=f"{name}/{link.name}", gravcomp=1.0, **placed(inverse_pose(above_pose) @ link.pose)
        )
        bodies[link.name] = body, link.pose
        _add_joint(spec, body, name, link)
    _add_drives(spec, name, params)
    _set_inertias(bodies, params)
    chain = params.chain
    bodies[chain.joints[-1].name][0].add_site(name=f"{name}/tip", group=_HIDDEN, **placed(chain.tip))
    _add_sensors(spec, name, [joint.name for joint in chain.joints], has_jaw=FINGERS[0] in bodies)
    if isinstance(params, MountedPsm):
        if (hand := params.tool.hand) is not None:
            _add_sensors_of(
                spec, name, _MOTOR, mujoco.mjtObj.mjOBJ_ACTUATOR, [motor.name for motor in hand.joints]
            )
            _add_joint_sensors(spec, name, [link.name for link in hand.links])
        if params.tool.roller is not None:
            _add_sensors_of(spec, name, _MOTOR, mujoco.mjtObj.mjOBJ_ACTUATOR, [ROLLER])
        _add_spheres(spec, name, params.tool.spheres, bodies)
    return bodies


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
        tie = {
            "name1": name,
            "name2": f"{arm}/{link.follow.joint}",
            "data": [0.0, link.follow.ratio, *[0.0] * 10],
        }
        spec.add_equality(
            name=name, type=mujoco.mjtEq.mjEQ_JOINT, objtype=mujoco.mjtObj.mjOBJ_JOINT, **tie, **_TIE
        )


def _add_drives(spec: mujoco.MjSpec, arm: str, params: MountedPsm | MountedEcm) -> None:
    """Give each independent joint its drive, and an instrument's discs the friction of wrist and jaw."""
    is_psm = isinstance(params, MountedPsm)
    driven = params.drives
    hand, roller = (params.tool.hand, params.tool.roller) if is_psm else (None, None)
    for name, drive in driven.items():
        if name != ROLLER and (hand is None or name not in (*hand.fingers, *hand.spreads)):
            _add_drive(spec, f"{arm}/{name}", drive)
    if hand is not None:
        hands.add_drives(spec, arm, hand, driven)
        hands.add_contacts(spec, arm, hand)
    if roller is not None:
        rollers.add_drive(spec, arm, roller, driven[ROLLER])
    for i, disc in enumerate(params.discs, 1):
        tendon = spec.add_tendon(
            name=f"{arm}/disc_{i}",
            damping=[disc.viscous_friction, 0.0, 0.0],
            frictionloss=disc.coulomb_friction,
        )
        for name, share in disc.shares.items():
            tendon.wrap_joint(f"{arm}/{name}", share)


def _add_drive(spec: mujoco.MjSpec, name: str, drive: Drive) -> None:
    """Add friction, elasticity and rotor inertia of a joint, and its servo.

    The servo has the inputs position, velocity and feed-forward effort.
    """
    joint = spec.joint(name)
    joint.damping, joint.frictionloss, joint.armature = (
        [drive.viscous_friction, 0.0, 0.0],
        drive.coulomb_friction,
        drive.armature,
    )
    if drive.elasticity:
        joint.stiffness, joint.springref = [drive.elasticity, 0.0, 0.0], -drive.offset / drive.elasticity
    lower, upper = joint.range
    actuator = spec.add_actuator(
        name=name,
        target=name,
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        ctrllimited=True,
        ctrlrange=[lower, upper],
        velrange=[-drive.velocity, drive.velocity],
        ffrange=[-drive.effort, drive.effort],
        forcelimited=True,
        forcerange=[-drive.effort, drive.effort],
    )
    inputs = mujoco.mjtCtrlInput
    actuator.set_to_pid(
        kp=drive.stiffness,
        kv=drive.damping,
        ctrlspec=int(inputs.mjINPUT_POS | inputs.mjINPUT_VEL | inputs.mjINPUT_FF),
    )


def _set_inertias(bodies: Bodies, params: MountedPsm | MountedEcm) -> None:
    """Carry the inertia of each link, given in the base frame with every joint at 0, to its body."""
    for link, given in params.bodies.items():
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


def _add_spheres(spec: mujoco.MjSpec, arm: str, spheres: tuple[ContactSphere, ...], bodies: Bodies) -> None:
    """Mark the contact spheres by sites, with sensors of their positions and velocities in the world."""
    for sphere in spheres:
        bodies[sphere.link][0].add_site(
            name=sphere_site(arm, sphere.name),
            pos=sphere.position,
            size=[sphere.radius, 0.0, 0.0],
            group=_HIDDEN,
        )
    for kind, what in (
        (mujoco.mjtSensor.mjSENS_FRAMEPOS, "position"),
        (mujoco.mjtSensor.mjSENS_FRAMELINVEL, "velocity"),
    ):
        for sphere in spheres:
            site = sphere_site(arm, sphere.name)
            spec.add_sensor(name=f"{site}/{what}", type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=site)


def _add_sensors(spec: mujoco.MjSpec, arm: str, joints: list[str], has_jaw: bool) -> None:
    """Add the sensors that the output ports need, in the order that `first_sensor` documents."""
    _add_joint_sensors(spec, arm, joints)
    site = mujoco.mjtObj.mjOBJ_SITE
    for kind, what in _POSE:
        spec.add_sensor(
            name=f"{arm}/cp/{what}",
            type=kind,
            objtype=site,
            objname=f"{arm}/tip",
            reftype=site,
            refname=f"{arm}/base",
        )
    for kind, what in (*_POSE, *_TWIST):
        spec.add_sensor(name=f"{arm}/tip/{what}", type=kind, objtype=site, objname=f"{arm}/tip")
    if has_jaw:
        _add_joint_sensors(spec, arm, list(FINGERS))


def _add_joint_sensors(spec: mujoco.MjSpec, arm: str, joints: list[str]) -> None:
    _add_sensors_of(spec, arm, _JOINT, mujoco.mjtObj.mjOBJ_JOINT, joints)


def _add_sensors_of(
    spec: mujoco.MjSpec,
    arm: str,
    kinds: tuple[tuple[mujoco.mjtSensor, str], ...],
    what: mujoco.mjtObj,
    names: list[str],
) -> None:
    """Add sensors of the positions, then the velocities, then the efforts of joints or motors."""
    for kind, label in kinds:
        for name in names:
            spec.add_sensor(name=f"{arm}/{label}/{name}", type=kind, objtype=what, objname=f"{arm}/{name}")
