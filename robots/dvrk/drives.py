"""The drives of PSM and ECM: servo, friction, elasticity, rotor inertia and limits of every joint.

It also has what compensates for the losses.

Sources: SAW = jhu-dvrk/sawIntuitiveResearchKit (commit 9e535e68), share/pid/sawControllersPID-{PSM,ECM}.json;
FONT = gafontanelli/DVRK-dynamicModel (commit 51c55d75), PSM_robot.cpp with PSM1_param.txt. SI units, radians.

The last four motors of a PSM turn discs of the instrument, and wrist and jaw move with more than one of them:
servo, friction and rotor inertia belong to the discs. Each joint gets the diagonal of its share; the friction
of the discs is kept coupled (`discs`, `friction`). See docs/decisions/0010.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import exp, inf, tanh
from types import MappingProxyType

import numpy as np

from robots.dvrk import ecm
from robots.dvrk import psm as psm_arm
from robots.dvrk.hand import Hand
from robots.dvrk.instruments import Instrument
from robots.dvrk.rolling_needle_driver import ROLLER
from schemas.plain_sum import plain_sum

__all__ = ["ECM", "FINGERS", "SMOOTHING", "Disc", "Drive", "discs", "friction", "psm"]

FINGERS = ("jaw_left", "jaw_right")
"""Of the jaw, each turned by half its angle."""

SMOOTHING = 50.0
"""s/rad, s/m: FONT's Coulomb friction is Fs tanh(50 dq)."""


@dataclass(frozen=True)
class Drive:
    """The drive of one joint; rad, N m and kg m^2, or m, N and kg."""

    stiffness: float
    """Proportional gain of the servo."""
    damping: float
    """Derivative gain, on the error of the velocity."""
    viscous_friction: float
    """Effort per velocity; 0 where the discs hold it."""
    coulomb_friction: float
    """Effort; 0 where the discs hold it."""
    elasticity: float
    """Effort per position: the joint asks for elasticity * q + offset."""
    offset: float
    armature: float
    """Inertia of the drive that is not in a body."""
    effort: float
    """Largest effort."""
    velocity: float
    """Largest velocity."""
    smoothing: float = SMOOTHING
    """How fast Coulomb friction changes its sign, s/rad or s/m."""
    static_friction: float = 0.0
    """Effort at rest beyond Coulomb's friction (Stribeck)."""
    stribeck_velocity: float = inf
    """At which it has fallen to 1/e."""


@dataclass(frozen=True)
class Disc:
    """One disc of an instrument: it turns by the sum over the joints of share * position; rad, N m."""

    shares: Mapping[str, float]
    viscous_friction: float
    coulomb_friction: float
    smoothing: float = SMOOTHING
    static_friction: float = 0.0
    stribeck_velocity: float = inf


_ARM = {
    "yaw": (120.0, 6.0, 0.136392294, 0.063000355, 0.135144709, 0.00726440463),
    "pitch": (120.0, 5.0, 0.137455713, 0.15057195, 0.35571592, 0.0758960511),
    "insertion": (6000.0, 200.0, 2.69, 0.596, 0.0, 0.0),
}
"""p, d (SAW), Fv, Fs, K, O (FONT). The inertia of these drives is in the identified masses."""

_DISC_STIFFNESS, _DISC_DAMPING = 6.0, 0.09
"""N m/rad, N m s/rad of all four discs (SAW)."""
_DISC_INERTIA = _DISC_DAMPING**2 / (4.0 * _DISC_STIFFNESS)
"""kg m^2: neither published identification states a rotor inertia of the discs (FONT has none,
WPI-AIM/dvrk_dynamics_identification finds negative ones); this is the one that the gains damp critically, d =
2 sqrt(p I).
"""
_DISC_FRICTION = ((0.0013, 0.0077), (0.0104, 0.0198), (0.0047, 0.0152), (0.0061, 0.0081))
"""Fv, Fs of the four discs (FONT, motors 4 to 7)."""
_ROLL_ELASTICITY, _ROLL_OFFSET = 0.0025, 0.0038
"""N m/rad, N m at the joint (FONT, K4 and O4)."""

_ECM_GAINS = {
    "yaw": (400.0, 30.0),
    "pitch": (1000.0, 80.0),
    "insertion": (10000.0, 1200.0),
    "roll": (20.0, 0.5),
}
"""p, d (SAW)."""


def psm(tool: Instrument) -> Mapping[str, Drive]:
    """Return the drives of a PSM with `tool` by joint, including those of its jaw or hand and the roller."""
    chain = psm_arm.chain(tool)
    drives = {
        joint.name: Drive(*_ARM[joint.name], 0.0, joint.effort, joint.velocity) for joint in chain.joints[:3]
    }
    square = {
        name: plain_sum(disc.shares.get(name, 0.0) ** 2 for disc in discs(tool)) for name in _moved(tool)
    }
    limits = {joint.name: (joint.effort, joint.velocity) for joint in tool.joints}
    if tool.jaw is not None:
        # Both fingers turn by half the jaw's angle and share its inertia and stiffness; the torque of each
        # works along the whole of it.
        square |= dict.fromkeys(FINGERS, 2.0 * square[FINGERS[0]])
        limits |= dict.fromkeys(FINGERS, (tool.jaw.effort, tool.jaw.velocity / 2.0))
    for name, share in square.items():
        elastic = (_ROLL_ELASTICITY, _ROLL_OFFSET) if name == "roll" else (0.0, 0.0)
        drives[name] = Drive(
            _DISC_STIFFNESS * share,
            _DISC_DAMPING * share,
            0.0,
            0.0,
            *elastic,
            _DISC_INERTIA * share,
            *limits[name],
        )
    if tool.roller is not None:
        share = (tool.roller.wire_radius / tool.roller.pulley) ** 2
        of_disc = (_DISC_STIFFNESS * share, _DISC_DAMPING * share, 0.0, 0.0, 0.0, 0.0, _DISC_INERTIA * share)
        drives[ROLLER] = Drive(*of_disc, tool.roller.joint.effort, tool.roller.joint.velocity)
    if tool.hand is not None:
        drives |= {
            joint.name: drive for joint, drive in zip(tool.hand.joints, _motors(tool.hand), strict=True)
        }
    return MappingProxyType(drives)


def _motors(hand: Hand) -> Iterator[Drive]:
    """Yield the drives of `hand` in the order of its joints.

    A closing is turned by a disc that winds a tendon up and lets it go; its friction stays with the motor, as
    the springs that open a finger do not turn it. A spread moves the end of a spring, with the friction of
    the first joints.
    """
    spring, friction = hand.phalanges[0].stiffness, float(hand.damping[0])
    for joint in hand.joints:
        gains = (_DISC_STIFFNESS, _DISC_DAMPING) if joint.name in hand.fingers else (spring, friction)
        armature = _DISC_INERTIA if joint.name in hand.fingers else 0.0
        yield Drive(*gains, 0.0, 0.0, 0.0, 0.0, armature, joint.effort, joint.velocity)


def discs(tool: Instrument) -> tuple[Disc, ...]:
    """Return the discs that turn roll, wrist and jaw of `tool`.

    The inverse of SAW's matrix from discs to joints determines by how much.
    """
    shares = np.linalg.inv(tool.actuator_to_joint)  # (disc, joint)
    names = _moved(tool)
    columns = [_column(name) for name in names]
    turned = [
        {
            name: float(row[column])
            for name, column in zip(names, columns, strict=True)
            if abs(row[column]) > 1e-9
        }
        for row in shares
    ]
    return tuple(Disc(moved, *losses) for moved, losses in zip(turned, _DISC_FRICTION, strict=True) if moved)


def _moved(tool: Instrument) -> tuple[str, ...]:
    return (*(joint.name for joint in tool.joints), *(FINGERS if tool.jaw is not None else ()))


def _column(name: str) -> int:
    """Return the column of a joint or finger in SAW's matrix: roll, wrist pitch, wrist yaw, jaw.

    The two pitch joints of a snake add up to its pitch.

    The two pitch joints of a snake add up to its pitch.
    """
    return next(
        i for i, kind in enumerate(("roll", "wrist_pitch", "wrist_yaw", "jaw")) if name.startswith(kind)
    )


def _of_ecm() -> Mapping[str, Drive]:
    """Return the drives of an ECM by joint.

    No friction of it is published: it is taken to be the same share of the largest effort as in the PSM's
    joint of that name.

    It is taken to be the same share of the largest effort as in the PSM's joint of that name.
    """
    # of disc 1 at the joint of a needle driver 400006
    friction_of_roll = np.array(_DISC_FRICTION[0]) * [0.6397**2, 0.6397]
    psm_friction = {name: row[2:4] for name, row in _ARM.items()} | {"roll": tuple(friction_of_roll.tolist())}
    psm_effort = {joint.name: joint.effort for joint in psm_arm.ARM_JOINTS} | {"roll": 0.33}
    drives: dict[str, Drive] = {}
    for joint in ecm.JOINTS:
        viscous, coulomb = (
            value * joint.effort / psm_effort[joint.name] for value in psm_friction[joint.name]
        )
        drives[joint.name] = Drive(
            *_ECM_GAINS[joint.name], viscous, coulomb, 0.0, 0.0, 0.0, joint.effort, joint.velocity
        )
    return MappingProxyType(drives)


ECM = _of_ecm()
"""The drives of the ECM by joint."""


def friction(
    drives: Mapping[str, Drive], dq: Mapping[str, float], wrist: Sequence[Disc] = ()
) -> dict[str, float]:
    """Return the friction (N m, N) by joint at the velocities `dq`, as FONT has it: smooth around zero.

    Of an identified arm it may be larger at rest (Stribeck).

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
