"""The MuJoCo model of one or more dVRK arms, built from the numbers in `robots.dvrk`.

Each arm is the serial chain of its DH table. All geoms are for the eye alone: they neither weigh nor collide.
"""

from __future__ import annotations

from math import pi

import mujoco
import numpy as np

from engines.mujoco.params import ArmParams, MujocoParams
from robots import rotation
from robots.dvrk import psm
from robots.dvrk.instruments import SHAFT_RADIUS, STEEL_DENSITY, WRIST_RADIUS
from robots.serial_chain import Joint, SerialChain
from schemas.vectors import Vector

__all__ = ["build", "first_sensor", "probe_body"]

_FRAME_SENSORS = {
    "pose": (mujoco.mjtSensor.mjSENS_FRAMEPOS, mujoco.mjtSensor.mjSENS_FRAMEQUAT),
    "twist": (mujoco.mjtSensor.mjSENS_FRAMELINVEL, mujoco.mjtSensor.mjSENS_FRAMEANGVEL),
}
_JOINT_SENSORS = (mujoco.mjtSensor.mjSENS_JOINTPOS, mujoco.mjtSensor.mjSENS_JOINTVEL, mujoco.mjtSensor.mjSENS_JOINTACTFRC)
_NO_MASS = 1e-6
"""kg (and kg m^2) of a link whose inertia is in the armature: MuJoCo wants a little in every moving body."""
_HIDDEN = 4
"""A group that MuJoCo's viewer does not show unless asked."""
_GREY, _STEEL, _BLUE = [0.55, 0.57, 0.6, 1.0], [0.8, 0.8, 0.82, 1.0], [0.15, 0.35, 0.75, 1.0]
_HOUSING = [0.068 / 2, 0.033 / 2, 0.093 / 2]
"""Half extents (m) of the tool housing as modelled in unina-icaros/dvrk-vrep."""


def probe_body(arm: str) -> str:
    """Return the name of the body whose origin and centre of mass is the centre of the probe."""
    return f"{arm}/{psm.JOINT_NAMES[-1]}"


def first_sensor(arm: str) -> str:
    """Return the name of the first of the arm's sensors: six positions, velocities, efforts; pose in base; pose and twist in the world."""
    return f"{arm}/{_JOINT_SENSORS[0].name}/{psm.JOINT_NAMES[0]}"


def build(params: MujocoParams) -> mujoco.MjModel:
    """Return the compiled model of all arms in `params`.

    The joint-space inertia of yaw, pitch and insertion at q = 0 is the identified one: what the bodies do not make up
    is armature, found by compiling once without.
    """
    spec = mujoco.MjSpec()
    spec.modelname = "dvrk"
    spec.compiler.degree = False
    spec.option.timestep = params.timestep * 1e-9
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.worldbody.add_light(pos=[0.0, 0.0, 2.0], type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL)
    for name, arm in params.arms.items():
        _add_arm(spec, name, arm)
    _set_armature(spec, list(params.arms))
    return spec.compile()


def _add_arm(spec: mujoco.MjSpec, name: str, arm: ArmParams) -> None:
    chain = arm.chain
    base = spec.worldbody.add_body(name=f"{name}/base", pos=arm.position, quat=_wxyz(np.array(arm.orientation)))
    base.add_site(name=f"{name}/base", group=_HIDDEN)
    body, bodies = base, list[mujoco.MjsBody]()
    for joint, servo in zip(chain.joints, psm.SERVO, strict=True):
        zero = joint.transform(0.0)
        body = body.add_body(name=f"{name}/{joint.name}", pos=zero[:3, 3], quat=_wxyz(rotation.from_matrix(zero)), gravcomp=1.0)
        bodies.append(body)
        _add_joint(spec, body, name, joint, servo)
    tip = chain.tip
    body.add_site(name=f"{name}/tip", pos=tip[:3, 3], quat=_wxyz(rotation.from_matrix(tip)), group=_HIDDEN)
    _set_masses(bodies, chain, arm)
    _add_geoms(bodies, chain, arm)
    _add_sensors(spec, name)


def _add_joint(spec: mujoco.MjSpec, body: mujoco.MjsBody, arm: str, joint: Joint, servo: psm.Servo) -> None:
    name = f"{arm}/{joint.name}"
    body.add_joint(
        name=name,
        type=mujoco.mjtJoint.mjJNT_HINGE if joint.kind == "revolute" else mujoco.mjtJoint.mjJNT_SLIDE,
        axis=[0.0, 0.0, 1.0],
        limited=True,
        range=[joint.lower, joint.upper],
        damping=[servo.viscous_friction, 0.0, 0.0],
        frictionloss=servo.coulomb_friction,
    )
    actuator = spec.add_actuator(
        name=name,
        target=name,
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        ctrllimited=True,
        ctrlrange=[joint.lower, joint.upper],
        velrange=[-joint.velocity, joint.velocity],
        forcelimited=True,
        forcerange=[-joint.effort, joint.effort],
    )
    actuator.set_to_pid(kp=servo.stiffness, kv=servo.damping)


def _set_masses(bodies: list[mujoco.MjsBody], chain: SerialChain, arm: ArmParams) -> None:
    """Give each link its mass; the insertion's centre of mass is where the yaw inertia grows with the insertion as identified.

    m ((z + dq)^2 - z^2) = dI, with z the distance of the centre of mass from the RCM along the shaft at insertion 0.
    """
    dq, growth = psm.YAW_INERTIA_GROWTH
    depth = (growth / psm.INSERTION_MASS - dq**2) / (2.0 * dq)
    probe_mass = STEEL_DENSITY * 4.0 / 3.0 * pi * arm.probe_radius**3
    wrist = chain.joints[5].a
    for body, mass, centre, inertia in (
        (bodies[0], _NO_MASS, [0.0, 0.0, 0.0], _NO_MASS),
        (bodies[1], _NO_MASS, [0.0, 0.0, 0.0], _NO_MASS),
        (bodies[2], psm.INSERTION_MASS, [0.0, 0.0, depth - chain.joints[2].d], _NO_MASS),
        (bodies[3], arm.tool.roll_mass, [0.0, 0.0, 0.0], 0.4 * arm.tool.roll_mass * SHAFT_RADIUS**2),
        (bodies[4], arm.tool.pitch_mass, [wrist / 2, 0.0, 0.0], arm.tool.pitch_mass * wrist**2 / 12.0),
        (bodies[5], probe_mass, [0.0, 0.0, 0.0], 0.4 * probe_mass * arm.probe_radius**2),
    ):
        body.mass, body.ipos, body.inertia, body.explicitinertial = mass, centre, [inertia] * 3, True


def _add_geoms(bodies: list[mujoco.MjsBody], chain: SerialChain, arm: ArmParams) -> None:
    unseen_by_physics = {"mass": 0.0, "contype": 0, "conaffinity": 0}
    shaft, wrist, carriage = chain.joints[3].d, chain.joints[5].a, -chain.joints[2].d
    capsule, box, sphere = mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_SPHERE
    # The insertion runs along -y of the pitch link; its column stands 43 mm beside the shaft (jhu-dvrk/dvrk_model, PSM).
    bodies[1].add_geom(type=capsule, size=[0.02, 0.0, 0.0], fromto=[0.043, carriage - 0.24, 0.0, 0.043, carriage, 0.0], rgba=_GREY, **unseen_by_physics)
    bodies[2].add_geom(type=box, size=_HOUSING, rgba=_BLUE, **unseen_by_physics)
    bodies[3].add_geom(type=capsule, size=[SHAFT_RADIUS, 0.0, 0.0], fromto=[0.0, 0.0, -shaft, 0.0, 0.0, 0.0], rgba=_GREY, **unseen_by_physics)
    bodies[4].add_geom(type=capsule, size=[WRIST_RADIUS, 0.0, 0.0], fromto=[0.0, 0.0, 0.0, wrist, 0.0, 0.0], rgba=_STEEL, **unseen_by_physics)
    bodies[5].add_geom(type=sphere, size=[arm.probe_radius, 0.0, 0.0], rgba=_STEEL, **unseen_by_physics)


def _add_sensors(spec: mujoco.MjSpec, arm: str) -> None:
    """Let MuJoCo lay out what the ports say: joints by field, the tip in the base frame, the tip in the world."""
    for kind in _JOINT_SENSORS:
        for joint in psm.JOINT_NAMES:
            spec.add_sensor(name=f"{arm}/{kind.name}/{joint}", type=kind, objtype=mujoco.mjtObj.mjOBJ_JOINT, objname=f"{arm}/{joint}")
    site = mujoco.mjtObj.mjOBJ_SITE
    for kind in _FRAME_SENSORS["pose"]:
        spec.add_sensor(name=f"{arm}/cp/{kind.name}", type=kind, objtype=site, objname=f"{arm}/tip", reftype=site, refname=f"{arm}/base")
    for kind in (*_FRAME_SENSORS["pose"], *_FRAME_SENSORS["twist"]):
        spec.add_sensor(name=f"{arm}/probe/{kind.name}", type=kind, objtype=site, objname=f"{arm}/tip")


def _set_armature(spec: mujoco.MjSpec, arms: list[str]) -> None:
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    inertia = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, inertia)
    for arm in arms:
        for name, servo in zip(psm.JOINT_NAMES, psm.SERVO, strict=True):
            dof = model.joint(f"{arm}/{name}").dofadr[0]
            wanted = servo.critical_inertia if servo.inertia is None else servo.inertia
            spec.joint(f"{arm}/{name}").armature = wanted - float(inertia[dof, dof])


def _wxyz(q: Vector) -> list[float]:
    x, y, z, w = q.tolist()
    return [w, x, y, z]
