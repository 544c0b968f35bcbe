"""The model as URDF.

A link is called `<arm>_<link>_link`, its joint `<arm>_<link>`. The bars of the linkage mimic the pitch or the
insertion. The two fingers mimic a joint `<arm>_jaw`, which moves a link without shape: its position is the
angle between them; likewise the pads of a roller a joint `<arm>_roller`. What can be moved about freely and
the world's own shapes are left out, a URDF being one robot.

Links that stand for a frame alone have all but no mass: PyBullet takes one without inertia for 1 kg, and
MuJoCo refuses it where it moves.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import atan2, hypot
from xml.etree.ElementTree import Element, SubElement

import mujoco
import numpy as np

from engines.mujoco.export.assets import FOLDER, file_of, numbers
from robots import rotation
from robots.dvrk.mounted.mounted_arm import MountedArm
from robots.dvrk.setup_joints import DrivenArm
from schemas.errors import ScenarioError
from schemas.vectors import Vector

__all__ = ["urdf"]

_KINDS = {mujoco.mjtJoint.mjJNT_HINGE: "revolute", mujoco.mjtJoint.mjJNT_SLIDE: "prismatic"}
_WORLD = "world"
_FRAME_MASS, _FRAME_INERTIA = 1e-6, 1e-9
"""kg, kg m^2, of a link for a frame: less than a fifth of the lightest link, the wrist yaw with 6.6e-6 kg."""
_AT_ORIGIN, _UPRIGHT = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])


@dataclass(frozen=True)
class _Lead:
    """How a joint is driven."""

    joint: str
    """Leading joint; empty: none."""
    ratio: float
    """Position over position of the leading joint."""
    servo: str
    """Servo with the joint's limits."""


def urdf(spec: mujoco.MjSpec, arms: Mapping[DrivenArm, MountedArm]) -> Element:
    """Return the root element `robot` of the model's URDF, with meshes as files in `FOLDER`."""
    model = spec.compile()
    robot = Element("robot", name=spec.modelname)
    # what MuJoCo needs to read it as it is
    SubElement(SubElement(robot, "mujoco"), "compiler", strippath="false", discardvisual="false")
    SubElement(robot, "link", name=_WORLD)
    leads = _leads(arms)
    for body in spec.bodies[1:]:
        if any(joint.type == mujoco.mjtJoint.mjJNT_FREE for joint in body.joints):
            continue
        _add_link(robot, spec, model, body)
        _add_joint(robot, spec, model, body, leads)
        for site in body.sites:
            if "/contact/" in site.name:
                continue  # contact spheres have no use outside Trocar
            _add_frame(robot, model, body, site)
    led: set[str] = set()
    for body in spec.bodies[1:]:
        for joint in body.joints:
            lead = leads.get(joint.name)
            if lead is not None and lead.joint and lead.joint not in led:
                led.add(lead.joint)
                _add_leader(robot, spec, body, lead)
    return robot


def _leads(arms: Mapping[DrivenArm, MountedArm]) -> dict[str, _Lead]:
    """Return by joint how the links of end effectors are driven.

    Links moved as a unit mimic the commanded joint; links on a tendon move freely.
    """
    leads: dict[str, _Lead] = {}
    for arm, params in arms.items():
        for motor in params.end_effector.motors:
            servo, lead = f"{arm}/{motor.name}", _Lead("", 1.0, f"{arm}/{motor.name}")
            if motor.kind in ("disc", "gear") and motor.joint not in motor.moves:
                lead = _Lead(f"{arm}/{motor.joint}", motor.ratio, servo)
            for link in motor.moves:
                leads.setdefault(f"{arm}/{link}", lead)
    return leads


def _add_link(robot: Element, spec: mujoco.MjSpec, model: mujoco.MjModel, body: mujoco.MjsBody) -> None:
    link = SubElement(robot, "link", name=_link(body.name))
    compiled = model.body(body.name)
    if mass := float(compiled.mass[0]):
        _add_inertial(link, mass, compiled.inertia, compiled.ipos, compiled.iquat)
    for geom in body.geoms:
        shape = SubElement(link, "collision" if geom.contype or geom.conaffinity else "visual")
        _add_shape(shape, geom)
        if shape.tag == "visual":
            surface = spec.material(geom.material)
            rgba = geom.rgba if surface is None else surface.rgba
            material = SubElement(
                shape, "material", name="_".join(f"{round(255 * channel)}" for channel in rgba)
            )
            SubElement(material, "color", rgba=numbers(rgba))


def _add_inertial(
    link: Element, mass: float, moments: Vector, pos: Vector = _AT_ORIGIN, quat: Vector = _UPRIGHT
) -> None:
    inertial = SubElement(link, "inertial")
    _add_origin(inertial, pos, quat)
    SubElement(inertial, "mass", value=repr(mass))
    xx, yy, zz = (repr(float(moment)) for moment in moments)
    SubElement(inertial, "inertia", ixx=xx, iyy=yy, izz=zz, ixy="0", ixz="0", iyz="0")


def _add_frame_link(robot: Element, name: str) -> None:
    _add_inertial(SubElement(robot, "link", name=name), _FRAME_MASS, np.full(3, _FRAME_INERTIA))


def _add_shape(shape: Element, geom: mujoco.MjsGeom) -> None:
    kind, size = geom.type, geom.size
    pos, quat = geom.pos, geom.quat
    if kind != mujoco.mjtGeom.mjGEOM_MESH and not np.isnan(geom.fromto[0]):
        start, end = geom.fromto[:3], geom.fromto[3:]
        pos, quat, size = (
            (start + end) / 2,
            _turn_z_to(end - start),
            np.array([size[0], np.linalg.norm(end - start) / 2, 0.0]),
        )
    _add_origin(shape, pos, quat)
    geometry = SubElement(shape, "geometry")
    match kind:
        case mujoco.mjtGeom.mjGEOM_MESH:
            SubElement(geometry, "mesh", filename=f"{FOLDER}/{file_of(geom.meshname)}")
        case mujoco.mjtGeom.mjGEOM_BOX:
            SubElement(geometry, "box", size=numbers(2.0 * size))
        case mujoco.mjtGeom.mjGEOM_SPHERE:
            SubElement(geometry, "sphere", radius=repr(float(size[0])))
        # URDF knows no capsule: its cylinder, without the caps
        case mujoco.mjtGeom.mjGEOM_CAPSULE | mujoco.mjtGeom.mjGEOM_CYLINDER:
            SubElement(geometry, "cylinder", radius=repr(float(size[0])), length=repr(2.0 * float(size[1])))
        case _:
            raise ScenarioError(f"a shape of kind {kind} does not exist in URDF")


def _add_joint(
    robot: Element,
    spec: mujoco.MjSpec,
    model: mujoco.MjModel,
    body: mujoco.MjsBody,
    leads: Mapping[str, _Lead],
) -> None:
    moving = next(iter(body.joints), None)
    name = _joint_element(moving.name if moving else body.name)
    joint = SubElement(robot, "joint", name=name, type=_KINDS[moving.type] if moving else "fixed")
    compiled = model.body(body.name)
    _add_origin(joint, compiled.pos, compiled.quat)
    SubElement(joint, "parent", link=_link(body.parent.name))
    SubElement(joint, "child", link=_link(body.name))
    if moving is None:
        return
    SubElement(joint, "axis", xyz=numbers(moving.axis))
    lead = leads.get(moving.name) or _lead_by_tie(spec, moving.name)
    if lead.joint:
        SubElement(joint, "mimic", joint=_joint_element(lead.joint), multiplier=repr(lead.ratio), offset="0")
    is_slide_of_turn = moving.name in leads and joint.get("type") == "prismatic"
    _add_limit(joint, spec, moving.range, lead.servo, lead.ratio if is_slide_of_turn else 1.0)
    SubElement(
        joint, "dynamics", damping=repr(float(moving.damping[0])), friction=repr(float(moving.frictionloss))
    )


def _lead_by_tie(spec: mujoco.MjSpec, joint: str) -> _Lead:
    """Return how a joint of the arm or of the linkage is driven."""
    tie = spec.equality(joint)
    return _Lead(tie.name2, float(tie.data[1]), tie.name2) if tie else _Lead("", 0.0, joint)


def _add_limit(joint: Element, spec: mujoco.MjSpec, span: Vector, servo_name: str, way: float = 1.0) -> None:
    """State range, effort and velocity; `way`: travel of the joint per radian of its servo, m/rad."""
    servo = spec.actuator(servo_name)
    lower, upper = (repr(float(end)) for end in span)
    SubElement(
        joint,
        "limit",
        lower=lower,
        upper=upper,
        effort=repr(float(servo.forcerange[1]) / way),
        velocity=repr(float(servo.velrange[1]) * way),
    )


def _add_leader(robot: Element, spec: mujoco.MjSpec, follower: mujoco.MjsBody, lead: _Lead) -> None:
    """Add the leading joint of `follower` and of the opposite link."""
    _add_frame_link(robot, _link(lead.joint))
    joint = SubElement(robot, "joint", name=_joint_element(lead.joint), type="revolute")
    SubElement(joint, "parent", link=_link(follower.parent.name))
    SubElement(joint, "child", link=_link(lead.joint))
    SubElement(joint, "axis", xyz="0 0 1")
    _add_limit(joint, spec, follower.joints[0].range / lead.ratio, lead.servo)


def _add_frame(robot: Element, model: mujoco.MjModel, body: mujoco.MjsBody, site: mujoco.MjsSite) -> None:
    """Add a link without mass or shape where a site is, such as the tip of an arm."""
    name = site.name.replace("/", "_")
    _add_frame_link(robot, name)
    joint = SubElement(robot, "joint", name=f"{name}_fixed", type="fixed")
    compiled = model.site(site.name)
    _add_origin(joint, compiled.pos, compiled.quat)
    SubElement(joint, "parent", link=_link(body.name))
    SubElement(joint, "child", link=name)


def _add_origin(element: Element, pos: Vector, quat: Vector) -> None:
    """State a pose; quaternion w first. URDF's angles turn about the fixed axes x, y, z in this order."""
    r = rotation.matrix(np.array([quat[1], quat[2], quat[3], quat[0]], float) / np.linalg.norm(quat))
    across = hypot(r[0, 0], r[1, 0])
    upright = across < 1e-9  # then only the difference of roll and yaw counts
    roll = atan2(-r[1, 2], r[1, 1]) if upright else atan2(r[2, 1], r[2, 2])
    SubElement(
        element,
        "origin",
        xyz=numbers(pos),
        rpy=numbers([roll, atan2(-r[2, 0], across), 0.0 if upright else atan2(r[1, 0], r[0, 0])]),
    )


def _turn_z_to(axis: Vector) -> Vector:
    """Return the quaternion (w, x, y, z) from z to `axis`."""
    quat = np.empty(4)
    mujoco.mju_quatZ2Vec(quat, np.ascontiguousarray(axis, float))
    return quat


def _link(body: str) -> str:
    return _WORLD if body == "world" else f"{body.replace('/', '_')}_link"


def _joint_element(joint: str) -> str:
    return joint.replace("/", "_")
