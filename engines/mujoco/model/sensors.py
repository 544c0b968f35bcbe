"""Sensors of an arm, in the order documented by `engines.mujoco.model.names.first_sensor`."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco

from engines.mujoco.model.names import sphere_site
from robots.dvrk.end_effectors.contact_sphere import ContactSphere

__all__ = ["add_arm_sensors", "add_joint_sensors", "add_motor_sensors", "add_sphere_sensors"]

_Kinds = tuple[tuple[mujoco.mjtSensor, str], ...]

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


def add_arm_sensors(spec: mujoco.MjSpec, arm: str, joints: Sequence[str]) -> None:
    """Add the sensors of the joints and of the tip, in the base frame and in the world."""
    add_joint_sensors(spec, arm, joints)
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


def add_joint_sensors(spec: mujoco.MjSpec, arm: str, joints: Sequence[str]) -> None:
    """Add sensors of the positions, then the velocities, then the efforts of joints."""
    _add(spec, arm, _JOINT, mujoco.mjtObj.mjOBJ_JOINT, joints)


def add_motor_sensors(spec: mujoco.MjSpec, arm: str, motors: Sequence[str]) -> None:
    """Add sensors of the positions, then the velocities, then the efforts of motors."""
    _add(spec, arm, _MOTOR, mujoco.mjtObj.mjOBJ_ACTUATOR, motors)


def _add(spec: mujoco.MjSpec, arm: str, kinds: _Kinds, objtype: mujoco.mjtObj, names: Sequence[str]) -> None:
    for kind, label in kinds:
        for name in names:
            spec.add_sensor(name=f"{arm}/{label}/{name}", type=kind, objtype=objtype, objname=f"{arm}/{name}")


def add_sphere_sensors(spec: mujoco.MjSpec, arm: str, spheres: Sequence[ContactSphere]) -> None:
    """Add sensors of the spheres' positions, then of their velocities, in the world."""
    for kind, what in (
        (mujoco.mjtSensor.mjSENS_FRAMEPOS, "position"),
        (mujoco.mjtSensor.mjSENS_FRAMELINVEL, "velocity"),
    ):
        for sphere in spheres:
            site = sphere_site(arm, sphere.name)
            spec.add_sensor(name=f"{site}/{what}", type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=site)
