"""Servos of joints and tendons: PID actuators with feed-forward, with friction and rotor inertia."""

from __future__ import annotations

import mujoco

from robots.dvrk.drive import Drive

__all__ = ["add_joint_drive", "add_servo"]


def add_joint_drive(spec: mujoco.MjSpec, name: str, joint_name: str, drive: Drive) -> None:
    """Add friction, elasticity and rotor inertia of a joint, and the servo called `name`."""
    joint = spec.joint(joint_name)
    joint.damping, joint.frictionloss, joint.armature = (
        [drive.viscous_friction, 0.0, 0.0],
        drive.coulomb_friction,
        drive.armature,
    )
    if drive.elasticity:
        joint.stiffness, joint.springref = [drive.elasticity, 0.0, 0.0], -drive.offset / drive.elasticity
    lower, upper = joint.range.tolist()
    add_servo(spec, name, joint_name, mujoco.mjtTrn.mjTRN_JOINT, drive, (lower, upper))


def add_servo(
    spec: mujoco.MjSpec,
    name: str,
    target: str,
    kind: mujoco.mjtTrn,
    drive: Drive,
    limits: tuple[float, float],
    least_force: float | None = None,
) -> None:
    """Add a servo called `name`, with the inputs position, velocity and feed-forward effort.

    Args:
        spec: the model.
        name: name of the actuator.
        target: joint or tendon.
        kind: transmission of `target`: joint or tendon.
        drive: gains, and largest velocity and effort.
        limits: range of the position.
        least_force: lower limit of the force; -effort unless given.
    """
    actuator = spec.add_actuator(
        name=name,
        target=target,
        trntype=kind,
        ctrllimited=True,
        ctrlrange=limits,
        velrange=[-drive.velocity, drive.velocity],
        ffrange=[-drive.effort, drive.effort],
        forcelimited=True,
        forcerange=[-drive.effort if least_force is None else least_force, drive.effort],
    )
    inputs = mujoco.mjtCtrlInput
    actuator.set_to_pid(
        kp=drive.stiffness,
        kv=drive.damping,
        ctrlspec=int(inputs.mjINPUT_POS | inputs.mjINPUT_VEL | inputs.mjINPUT_FF),
    )
