"""What moves the fingers of a hand: springs and friction in the joints, spreads, and tendons.

A spring spreads each finger, and a tendon closes it.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations
from typing import Any

import mujoco

from robots.dvrk.drives import Drive
from robots.dvrk.hand import Hand, HandLink

__all__ = ["add_contacts", "add_drives"]

_STOP = {"solref": [1e-3, 1.0], "solimp": [0.999, 0.9999, 1e-4, 0.5, 2.0]}
"""Of the stops in the joints, and of fingers that touch: as stiff as the ties of a linkage, for what they
hold weighs two grams.
"""


def add_drives(spec: mujoco.MjSpec, arm: str, hand: Hand, drives: Mapping[str, Drive]) -> None:
    """Give `hand` its springs, tendons and motors; motors are called `<arm>/<finger>` and `<arm>/<spread>`.

    A tendon's length is the finger's closing (rad), so its force is the torque at the first pulley (N m). A
    motor that lets go turns its own rotor, with the torque for the closing's largest acceleration; it pushes
    no harder: springs open the finger.
    """
    n = len(hand.phalanges)
    for i, (finger, spread) in enumerate(zip(hand.fingers, hand.spreads, strict=True)):
        links = hand.links[n * i : n * i + n]
        drive = drives[finger]
        _add_springs(spec, arm, hand, links)
        tendon = spec.add_tendon(name=f"{arm}/{finger}", armature=drive.armature)
        for link in links:
            tendon.wrap_joint(f"{arm}/{link.name}", link.phalanx.pulley / links[0].phalanx.pulley)
        forces = [-drive.armature * hand.acceleration, drive.effort]
        _add_motor(
            spec,
            f"{arm}/{finger}",
            drive,
            hand.joints[i].lower,
            hand.joints[i].upper,
            trntype=mujoco.mjtTrn.mjTRN_TENDON,
            forcerange=forces,
        )
        first = links[0].phalanx
        target = {"target": f"{arm}/{links[0].name}", "trntype": mujoco.mjtTrn.mjTRN_JOINT}
        _add_motor(spec, f"{arm}/{spread}", drives[spread], first.lower, first.upper, **target)


def _add_springs(spec: mujoco.MjSpec, arm: str, hand: Hand, links: tuple[HandLink, ...]) -> None:
    """Set the springs and friction of all joints of a finger except the first.

    The motor of the spread is the spring of the first joint.
    """
    for i, (link, damping) in enumerate(zip(links, hand.damping.tolist(), strict=True)):
        joint, phalanx = spec.joint(f"{arm}/{link.name}"), link.phalanx
        joint.solref_limit, joint.solimp_limit = _STOP["solref"], _STOP["solimp"]
        if i:
            joint.damping, joint.stiffness, joint.springref = (
                [damping, 0.0, 0.0],
                [phalanx.stiffness, 0.0, 0.0],
                phalanx.rest,
            )


def _add_motor(
    spec: mujoco.MjSpec, name: str, drive: Drive, lower: float, upper: float, **fields: Any
) -> None:
    motor: dict[str, Any] = {
        "target": name,
        "ctrllimited": True,
        "ctrlrange": [lower, upper],
        "velrange": [-drive.velocity, drive.velocity],
        "ffrange": [-drive.effort, drive.effort],
        "forcelimited": True,
        "forcerange": [-drive.effort, drive.effort],
    }
    inputs = mujoco.mjtCtrlInput
    actuator = spec.add_actuator(name=name, **{**motor, **fields})
    actuator.set_to_pid(
        kp=drive.stiffness,
        kv=drive.damping,
        ctrlspec=int(inputs.mjINPUT_POS | inputs.mjINPUT_VEL | inputs.mjINPUT_FF),
    )


def add_contacts(spec: mujoco.MjSpec, arm: str, hand: Hand) -> None:
    """Let the fingers of one hand touch one another, which else nothing of an arm does."""
    n = len(hand.phalanges)
    fingers = [hand.links[i : i + n] for i in range(0, len(hand.links), n)]
    for one, other in combinations(fingers, 2):
        for a in one:
            for b in other:
                spec.add_pair(geomname1=f"{arm}/{a.name}", geomname2=f"{arm}/{b.name}", **_STOP)
