"""What moves the fingers of a hand: springs and friction in the joints, a tendon along each finger, and the motor that pulls it."""

from __future__ import annotations

from itertools import combinations

import mujoco

from robots.dvrk.drives import Drive
from robots.dvrk.hand import Hand

__all__ = ["add_contacts", "add_drives", "add_sensors"]


_STOP = {"solref": [1e-3, 1.0], "solimp": [0.999, 0.9999, 1e-4, 0.5, 2.0]}
"""Of the stops in the joints, and of fingers that touch: as stiff as the ties of a linkage, for what they hold weighs two grams."""


def add_drives(spec: mujoco.MjSpec, arm: str, hand: Hand, drive: Drive) -> None:
    """Give the joints of `hand` their springs and friction, and each finger its tendon and its motor, called `<arm>/<finger>`.

    The tendon's length is the finger's closing (rad), so its force is the torque at the first pulley (N m). A motor that lets go turns its own
    rotor, by as much as that takes at the closing's largest acceleration; beyond that it pushes nothing: springs open the finger.
    """
    first, n = hand.phalanges[0], len(hand.phalanges)
    for i, finger in enumerate(hand.fingers):
        tendon = spec.add_tendon(name=f"{arm}/{finger}", armature=drive.armature)
        for link, damping in zip(hand.links[n * i : n * i + n], hand.damping.tolist(), strict=True):
            joint, phalanx = spec.joint(f"{arm}/{link.name}"), link.phalanx
            joint.damping, joint.stiffness, joint.springref = [damping, 0.0, 0.0], [phalanx.stiffness, 0.0, 0.0], phalanx.rest
            joint.solref_limit, joint.solimp_limit = _STOP["solref"], _STOP["solimp"]
            tendon.wrap_joint(joint.name, phalanx.pulley / first.pulley)
        lower, upper = hand.joints[i].lower, hand.joints[i].upper
        actuator = spec.add_actuator(
            name=tendon.name,
            target=tendon.name,
            trntype=mujoco.mjtTrn.mjTRN_TENDON,
            ctrllimited=True,
            ctrlrange=[lower, upper],
            velrange=[-drive.velocity, drive.velocity],
            ffrange=[-drive.effort, drive.effort],
            forcelimited=True,
            forcerange=[-drive.armature * hand.acceleration, drive.effort],
        )
        inputs = mujoco.mjtCtrlInput
        actuator.set_to_pid(kp=drive.stiffness, kv=drive.damping, ctrlspec=int(inputs.mjINPUT_POS | inputs.mjINPUT_VEL | inputs.mjINPUT_FF))


def add_sensors(spec: mujoco.MjSpec, arm: str, hand: Hand) -> None:
    """Let MuJoCo lay out closings, their velocities and the torques of the motors."""
    sensors, tendon = mujoco.mjtSensor, mujoco.mjtObj.mjOBJ_TENDON
    for kind, what in ((sensors.mjSENS_TENDONPOS, "position"), (sensors.mjSENS_TENDONVEL, "velocity"), (sensors.mjSENS_TENDONACTFRC, "effort")):
        for finger in hand.fingers:
            spec.add_sensor(name=f"{arm}/{what}/{finger}", type=kind, objtype=tendon, objname=f"{arm}/{finger}")


def add_contacts(spec: mujoco.MjSpec, arm: str, hand: Hand) -> None:
    """Let the fingers of one hand touch one another, which else nothing of an arm does."""
    n = len(hand.phalanges)
    fingers = [hand.links[i : i + n] for i in range(0, len(hand.links), n)]
    for one, other in combinations(fingers, 2):
        for a in one:
            for b in other:
                spec.add_pair(geomname1=f"{arm}/{a.name}", geomname2=f"{arm}/{b.name}", **_STOP)
