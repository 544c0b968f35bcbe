"""An end effector in the model: servos, tendons, springs, ties and sensors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations, pairwise

import mujoco

from engines.mujoco.model.rigid import RIGID, tie
from engines.mujoco.model.sensors import add_joint_sensors, add_motor_sensors
from engines.mujoco.model.servo import add_joint_drive, add_servo
from robots.dvrk.drive import Drive
from robots.dvrk.end_effectors.end_effector import EndEffector, Motor
from robots.dvrk.link import Link
from robots.serial_chain import Joint

__all__ = ["add_motors", "add_sensors", "add_ties", "sensed_motors"]


def add_motors(
    spec: mujoco.MjSpec, arm: str, effector: EndEffector, links: Sequence[Link], drives: Mapping[str, Drive]
) -> None:
    """Give the links of `effector` their motors, called `<arm>/<motor>`."""
    joints = {joint.name: joint for joint in effector.joints}
    for link in links:
        if link.spring is not None:
            joint, spring = spec.joint(f"{arm}/{link.name}"), link.spring
            joint.damping, joint.stiffness = [spring.damping, 0.0, 0.0], [spring.stiffness, 0.0, 0.0]
            joint.springref = spring.rest
    for motor in effector.motors:
        drive, joint = drives[motor.name], joints[motor.joint]
        match motor.kind:
            case "disc" | "spring":
                (link,) = motor.moves
                add_joint_drive(spec, f"{arm}/{motor.name}", f"{arm}/{link}", drive)
            case "gear":
                _add_gear(spec, arm, motor, drive, joint)
            case "tendon":
                _add_tendon(spec, arm, motor, drive, joint)
    _let_fingers_touch(spec, arm, effector)


def _add_gear(spec: mujoco.MjSpec, arm: str, motor: Motor, drive: Drive, joint: Joint) -> None:
    """Add a motor of links tied to each other.

    The links share the inertia of the rotor: links are light, and MuJoCo's contacts give way in proportion to
    the inverse of the touching masses.
    """
    name = f"{arm}/{motor.name}"
    tendon = spec.add_tendon(name=name)
    for link, factor in motor.moves.items():
        spec.joint(f"{arm}/{link}").armature = len(motor.moves) * drive.armature * factor**2
        tendon.wrap_joint(f"{arm}/{link}", factor)
    for one, other in pairwise(motor.moves):
        tie(spec, f"{arm}/{motor.tie}", f"{arm}/{one}", f"{arm}/{other}")
    add_servo(spec, name, name, mujoco.mjtTrn.mjTRN_TENDON, drive, (joint.lower, joint.upper))


def _add_tendon(spec: mujoco.MjSpec, arm: str, motor: Motor, drive: Drive, joint: Joint) -> None:
    """Add a pulling motor.

    Letting go, the motor turns the rotor, with the torque for the joint's largest acceleration, and pushes no
    harder: springs open the finger.
    """
    name = f"{arm}/{motor.name}"
    tendon = spec.add_tendon(name=name, armature=drive.armature)
    for link, factor in motor.moves.items():
        # as stiff as a tie, for what it holds weighs two grams
        stopped = spec.joint(f"{arm}/{link}")
        stopped.solref_limit, stopped.solimp_limit = RIGID["solref"], RIGID["solimp"]
        tendon.wrap_joint(f"{arm}/{link}", factor)
    push = -drive.armature * joint.acceleration
    add_servo(spec, name, name, mujoco.mjtTrn.mjTRN_TENDON, drive, (joint.lower, joint.upper), push)


def _let_fingers_touch(spec: mujoco.MjSpec, arm: str, effector: EndEffector) -> None:
    """Let fingers on tendons touch each other; no other links of an arm touch."""
    fingers = [motor.moves for motor in effector.motors if motor.kind == "tendon"]
    for one, other in combinations(fingers, 2):
        for a in one:
            for b in other:
                spec.add_pair(geomname1=f"{arm}/{a}", geomname2=f"{arm}/{b}", **RIGID)


def add_ties(spec: mujoco.MjSpec, arm: str, effector: EndEffector) -> None:
    """Tie the links of motors with the same joint: a jaw does not give way sideways."""
    for joint in effector.joints:
        motors = [motor for motor in effector.motors if motor.joint == joint.name]
        for one, other in pairwise(motors):
            (first,), (second,) = one.moves, other.moves
            tie(spec, f"{arm}/{joint.name}", f"{arm}/{first}", f"{arm}/{second}")


def add_sensors(spec: mujoco.MjSpec, arm: str, effector: EndEffector, links: Sequence[Link]) -> None:
    """Add the sensors of the motors, then of links with readings."""
    at_joints, at_motors = sensed_motors(effector)
    add_joint_sensors(spec, arm, list(at_joints))
    add_motor_sensors(spec, arm, list(at_motors))
    add_joint_sensors(spec, arm, [link.name for link in links if link.reading])


def sensed_motors(effector: EndEffector) -> tuple[Mapping[str, Motor], Mapping[str, Motor]]:
    """Return the motors by the names of their sensors, in the order of their joints.

    Motors of discs, measured at the joints of their links, come first.
    """
    motors = [motor for joint in effector.joints for motor in effector.motors if motor.joint == joint.name]
    at_joints = {link: motor for motor in motors if motor.kind == "disc" for link in motor.moves}
    return at_joints, {motor.name: motor for motor in motors if motor.kind != "disc"}
