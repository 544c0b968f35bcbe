"""The drives of PSM and ECM: servo, friction, elasticity, rotor inertia and limits of every joint.

The friction is here too, for compensation.

Sources: SAW = jhu-dvrk/sawIntuitiveResearchKit (commit 9e535e68), share/pid/sawControllersPID-{PSM,ECM}.json;
FONT = gafontanelli/DVRK-dynamicModel (commit 51c55d75), PSM_robot.cpp with PSM1_param.txt. SI units, radians.

The last four motors of a PSM turn discs of the instrument, and wrist and jaw move with more than one of them:
servo, friction and rotor inertia belong to the discs. Each joint gets the diagonal of its share; the friction
of the discs is kept coupled (`discs`, `friction`). See docs/decisions/0010.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import exp, tanh
from types import MappingProxyType

import numpy as np

from robots.dvrk import ecm, identified_mtm, mtm, si
from robots.dvrk import psm as psm_arm
from robots.dvrk.drive import JAW_COLUMN, Disc, Drive, disc_shares
from robots.dvrk.instruments import Instrument
from robots.serial_chain import Joint
from schemas.plain_sum import plain_sum

__all__ = ["ECM", "ECM_SI", "MTM", "discs", "friction", "psm"]

_ARM = {
    "yaw": (120.0, 6.0, 0.136392294, 0.063000355, 0.135144709, 0.00726440463),
    "pitch": (120.0, 5.0, 0.137455713, 0.15057195, 0.35571592, 0.0758960511),
    "insertion": (6000.0, 200.0, 2.69, 0.596, 0.0, 0.0),
}
"""p, d (SAW), Fv, Fs, K, O (FONT). The inertia of these drives is in the identified masses."""
_ARM_SI = {"yaw": (600.0, 30.0), "pitch": (600.0, 30.0), "insertion": (6000.0, 200.0)}
"""p, d (SAW share/pid/sawControllersPID-PSM-Si.json); friction and elasticity of the Classic stand in."""

_DISC_FRICTION = ((0.0013, 0.0077), (0.0104, 0.0198), (0.0047, 0.0152), (0.0061, 0.0081))
"""Fv, Fs of the four discs (FONT, motors 4 to 7)."""
_COLUMNS = ("roll", "wrist_pitch", "wrist_yaw")
"""Joints by column of `disc_shares`, before the jaw; both pitch joints of a snake add up to a pitch."""
_ROLL_ELASTICITY, _ROLL_OFFSET = 0.0025, 0.0038
"""N m/rad, N m at the joint (FONT, K4 and O4)."""

_ECM_GAINS = {
    "yaw": (400.0, 30.0),
    "pitch": (1000.0, 80.0),
    "insertion": (10000.0, 1200.0),
    "roll": (20.0, 0.5),
}
"""p, d (SAW)."""
_ECM_GAINS_SI = {
    "yaw": (600.0, 30.0),
    "pitch": (600.0, 30.0),
    "insertion": (15000.0, 500.0),
    "roll": (100.0, 3.0),
}
"""p, d (SAW share/pid/sawControllersPID-ECM-Si.json)."""


def psm(tool: Instrument, generation: si.Generation = "classic") -> Mapping[str, Drive]:
    """Return the drives of a PSM with `tool` by joint, then of the end effector by motor."""
    joints, gains = psm_arm.ARM_JOINTS, dict[str, tuple[float, float]]()
    if generation == "si":
        joints, gains = si.PSM_JOINTS, _ARM_SI
    drives = {
        joint.name: Drive(
            *gains.get(joint.name, _ARM[joint.name][:2]),
            *_ARM[joint.name][2:],
            0.0,
            joint.effort,
            joint.velocity,
        )
        for joint in joints
    }
    turning = discs(tool)
    for joint in tool.joints:
        share = plain_sum(disc.shares.get(joint.name, 0.0) ** 2 for disc in turning)
        elastic = (_ROLL_ELASTICITY, _ROLL_OFFSET) if joint.name == "roll" else (0.0, 0.0)
        drives[joint.name] = Drive.of_disc(share, joint.effort, joint.velocity, *elastic)
    drives |= {motor.name: motor.drive for motor in tool.end_effector.motors}
    return MappingProxyType(drives)


def discs(tool: Instrument) -> tuple[Disc, ...]:
    """Return the discs of roll, wrist and jaw of `tool`."""
    columns = {joint.name: _column(joint.name) for joint in tool.joints}
    for motor in tool.end_effector.motors:
        if motor.kind == "disc":
            columns |= dict.fromkeys(motor.moves, JAW_COLUMN)
    turned = [
        {name: float(row[column]) for name, column in columns.items() if row[column]}
        for row in disc_shares(tool.actuator_to_joint)
    ]
    return tuple(Disc(moved, *losses) for moved, losses in zip(turned, _DISC_FRICTION, strict=True) if moved)


def _column(joint: str) -> int:
    return next(i for i, kind in enumerate(_COLUMNS) if joint.startswith(kind))


def _of_ecm(joints: Sequence[Joint], gains: Mapping[str, tuple[float, float]]) -> Mapping[str, Drive]:
    """Return the drives of an ECM by joint, with p and d by joint.

    No friction is published: the same share of the largest effort as in the PSM's joint of the same name
    stands in.
    """
    # of disc 1 at the joint of a needle driver 400006
    friction_of_roll = np.array(_DISC_FRICTION[0]) * [0.6397**2, 0.6397]
    psm_friction = {name: row[2:4] for name, row in _ARM.items()} | {"roll": tuple(friction_of_roll.tolist())}
    psm_effort = {joint.name: joint.effort for joint in psm_arm.ARM_JOINTS} | {"roll": 0.33}
    drives: dict[str, Drive] = {}
    for joint, classic in zip(joints, ecm.JOINTS, strict=True):
        viscous, coulomb = (
            value * classic.effort / psm_effort[joint.name] for value in psm_friction[joint.name]
        )
        drives[joint.name] = Drive(
            *gains[joint.name], viscous, coulomb, 0.0, 0.0, 0.0, joint.effort, joint.velocity
        )
    return MappingProxyType(drives)


ECM = _of_ecm(ecm.JOINTS, _ECM_GAINS)
"""The drives of the ECM by joint."""
ECM_SI = _of_ecm(si.ECM_JOINTS, _ECM_GAINS_SI)
"""The drives of the Si's ECM by joint; the Classic's friction stands in."""


_MTM_GAINS = ((100.0, 10.0), (80.0, 5.0), (80.0, 5.0), (3.0, 0.35), (1.0, 0.028), (0.4, 0.015), (0.15, 0.005))
"""p, d of the seven joints (SAW share/pid/sawControllersPID-MTM.json)."""
_ROLL_STIFFNESS, _ROLL_DAMPING = _MTM_GAINS[-1]
_ROLL_ROTOR = _ROLL_DAMPING**2 / (4.0 * _ROLL_STIFFNESS)
"""kg m^2 of the wrist roll's motor: no identification sees it; the gains damp this value critically."""


def _of_mtm() -> Mapping[str, Drive]:
    """Return the drives of a master by joint, with the identified friction of the motors."""
    joints, losses = mtm.chain("MTML").joints, identified_mtm.FRICTION
    rotors = (*(0.0,) * (len(joints) - 1), _ROLL_ROTOR)
    rows = zip(joints, _MTM_GAINS, losses, rotors, strict=True)
    return MappingProxyType(
        {
            joint.name: Drive(*gains, *lost, 0.0, 0.0, rotor, joint.effort, joint.velocity)
            for joint, gains, lost, rotor in rows
        }
    )


MTM = _of_mtm()
"""The drives of a master by joint."""


def friction(
    drives: Mapping[str, Drive], dq: Mapping[str, float], wrist: Sequence[Disc] = ()
) -> dict[str, float]:
    """Return the friction (N m, N) by joint at the velocities `dq`, as FONT has it: smooth around zero.

    For an identified arm friction at rest may be larger (Stribeck).

    Args:
        drives: by joint.
        dq: velocities by joint, rad/s or m/s; of a jaw, by finger.
        wrist: the discs of the instrument, if any.
    """
    result = {name: _friction(drives[name], v) for name, v in dq.items()}
    for disc in wrist:
        torque = _friction(disc, plain_sum(share * dq[name] for name, share in disc.shares.items()))
        for name, share in disc.shares.items():
            result[name] += share * torque
    return result


def _friction(of: Drive | Disc, v: float) -> float:
    dry = of.coulomb_friction + of.static_friction * exp(-((v / of.stribeck_velocity) ** 2))
    return of.viscous_friction * v + dry * tanh(of.smoothing * v)
