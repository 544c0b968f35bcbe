"""The parallelogram linkages that transmit the pitch to the instrument column, and the counterweight.

The real arm has no joint in its remote centre of motion (RCM): a double parallelogram turns the column about
that point. In the model the column (body `pitch`) has its joint in the RCM, so that the kinematics are exact,
and the bars hang beside it, tied to the pitch one to one. All pivots lie in the plane x = 0 of the base frame
`<arm>_base` with every joint at 0; their axes are parallel to the pitch axis, -x. A parallelogram closes in
every position if its opposite sides are equal vectors, which is how the pivots are written here.

Sources: dvrk_env = WPI-AIM/dvrk_env (commit 675a3fa), dvrk_description/psm/psm.urdf.xacro and
ecm/ecm.urdf.xacro, lengths from CAD (see docs/decisions/0008). SI units.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from schemas.plain_sum import plain_sum

__all__ = [
    "ECM",
    "INSERTION_AXIS",
    "LINKAGES",
    "MTM",
    "PITCH_AXIS",
    "PSM",
    "Linkage",
    "PassiveJoint",
    "Pin",
]

Point = tuple[float, float, float]

PITCH_AXIS: Point = (-1.0, 0.0, 0.0)
"""Axis of the pitch joint, a master's elbow and every pivot, in the base frame with every joint at 0."""
INSERTION_AXIS: Point = (0.0, 0.0, -1.0)
"""Direction of the insertion, same frame."""


@dataclass(frozen=True)
class PassiveJoint:
    """A body of the linkage and the joint that joins it to its parent, followed one to one or in reverse."""

    name: str
    """Name of the body and of the joint."""
    parent: str
    follows: Literal["pitch", "insertion", "elbow_pitch"]
    """Joint of the arm that decides the position: pitch or elbow of a hinge, insertion of a slide."""
    ratio: float
    """Position of this joint over that of the joint it follows."""
    pivot: Point
    """A point on the joint's axis, m, in the base frame with every joint at 0."""


@dataclass(frozen=True)
class Pin:
    """A pivot that closes a loop: a point in which two bodies meet in every position of the arm."""

    bodies: tuple[str, str]
    position: Point
    """m, in the base frame with every joint at 0."""


@dataclass(frozen=True)
class Linkage:
    """Passive bodies of one kind of arm, and the pins that close their loops."""

    joints: tuple[PassiveJoint, ...]
    pins: tuple[Pin, ...]


def _at(*vectors: tuple[float, float]) -> Point:
    """Return the point at the sum of vectors (y, z) in the linkage's plane."""
    return (0.0, plain_sum(v[0] for v in vectors), plain_sum(v[1] for v in vectors))


# PSM. Vectors (y, z) at pitch 0; back link of 0.150 m leaning by 0.29073 rad, bars of 0.516 m (dvrk_env
# psm.urdf.xacro).
_PSM_BACK = (-0.516, 0.0)
"""Back pivot on the yaw link, as far from the RCM as the bars are long."""
_PSM_FRONT = (-0.420, 0.0)
"""Front pivot on the yaw link, 0.096 m before the back one."""
_PSM_LOWER = (-0.04300, 0.14371)
"""Vector from the back pivot to the lower bar; also from the front pivot to it, and from the RCM to the lower
bar's pivot on the column.
"""
_PSM_UPPER = (-0.03912, 0.18003)
"""Vector from the back pivot to the upper bar; also from the RCM to the upper bar's pivot on the column."""

PSM = Linkage(
    joints=(
        PassiveJoint("pitch_back", "yaw", "pitch", 1.0, _at(_PSM_BACK)),
        PassiveJoint("pitch_front", "yaw", "pitch", 1.0, _at(_PSM_FRONT)),
        PassiveJoint("pitch_bottom", "pitch_back", "pitch", -1.0, _at(_PSM_BACK, _PSM_LOWER)),
        PassiveJoint("pitch_top", "pitch_back", "pitch", -1.0, _at(_PSM_BACK, _PSM_UPPER)),
        PassiveJoint("counterweight", "pitch", "insertion", -1.0, (0.0, -0.043, 0.288)),
    ),
    pins=(
        Pin(("pitch_bottom", "pitch"), _at(_PSM_LOWER)),
        Pin(("pitch_top", "pitch"), _at(_PSM_UPPER)),
        Pin(("pitch_bottom", "pitch_front"), _at(_PSM_FRONT, _PSM_LOWER)),
    ),
)
"""The counterweight runs in the column (0.043 m beside the instrument's axis, dvrk_env) by the insertion's
cable: as far up as the instrument goes down (the model of Fontanelli et al., IROS 2017, has it so); its
height is an assumption without effect on the dynamics at pitch 0, see `robots.dvrk.arm_bodies`.
"""

# ECM (dvrk_env ecm.urdf.xacro). There the front link drives, and the back one guides the lower bar.
_ECM_FRONT = (-0.3404, 0.0)
"""Front pivot on the yaw link, as far from the RCM as the bars are long."""
_ECM_BACK = (-0.37697, -0.0098)
"""Back pivot on the yaw link."""
_ECM_LOWER = (-0.10300, 0.28681)
"""Vector from the front pivot to the lower bar; also from the back pivot to it, and from the RCM to the lower
bar's pivot on the column.
"""
_ECM_UPPER = (-0.10847, 0.32426)
"""Vector from the front pivot to the upper bar; also from the RCM to the upper bar's pivot on the column."""

ECM = Linkage(
    joints=(
        PassiveJoint("pitch_front", "yaw", "pitch", 1.0, _at(_ECM_FRONT)),
        PassiveJoint("pitch_back", "yaw", "pitch", 1.0, _at(_ECM_BACK)),
        PassiveJoint("pitch_bottom", "pitch_front", "pitch", -1.0, _at(_ECM_FRONT, _ECM_LOWER)),
        PassiveJoint("pitch_top", "pitch_front", "pitch", -1.0, _at(_ECM_FRONT, _ECM_UPPER)),
    ),
    pins=(
        Pin(("pitch_bottom", "pitch"), _at(_ECM_LOWER)),
        Pin(("pitch_top", "pitch"), _at(_ECM_UPPER)),
        Pin(("pitch_bottom", "pitch_back"), _at(_ECM_BACK, _ECM_LOWER)),
    ),
)

# MTM (model of WPI-AIM/dvrk_dynamics_identification, commit 7697d3a, main_mtm.ipynb: l_b2f and l_arm). Crank
# and bar drive the forearm from a motor at the shoulder; here the forearm leads them.
_MTM_CRANK, _MTM_UPPER_ARM = (-0.100, 0.0), (0.0, -0.2794)

MTM = Linkage(
    joints=(
        PassiveJoint("crank", "shoulder_pitch", "elbow_pitch", 1.0, (0.0, 0.0, 0.0)),
        PassiveJoint("bar", "crank", "elbow_pitch", -1.0, _at(_MTM_CRANK)),
    ),
    pins=(Pin(("bar", "elbow_pitch"), _at(_MTM_CRANK, _MTM_UPPER_ARM)),),
)

LINKAGES: Mapping[str, Linkage] = {
    **dict.fromkeys(("PSM1", "PSM2", "PSM3"), PSM),
    "ECM": ECM,
    **dict.fromkeys(("MTML", "MTMR"), MTM),
}
"""Linkage by the arm's name."""
