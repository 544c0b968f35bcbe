"""PSM, ECM and setup joints of the da Vinci Si: numbers with their sources, and what stands in for others.

Source: SAW = jhu-dvrk/sawIntuitiveResearchKit (commit 9e535e68). share/kinematic/PSM_Si.json and ECM_Si.json
have the kinematics, which are those of the Classic (right angles exact), ranges from the calibration of three
PSMs ("a bit approximative" there), and efforts from currents; share/arm/suj-si-simulated.json has the setup
joints. Trajectories have the Classic's velocities there. Masses, inertias, friction and linkages of the Si
are not published, but for masses of a gravity compensation (PSM_Si_physical.json), without inertias: the
Classic's stand in. SI units, radians.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from math import inf, pi, radians
from typing import Literal

from robots.dvrk import ecm, psm
from robots.dvrk.instruments import Instrument
from robots.dvrk.setup_joints import CartArm
from robots.serial_chain import Joint, SerialChain

__all__ = [
    "ECM_JOINTS",
    "LONGER",
    "PSM_JOINTS",
    "SIMULATED",
    "Generation",
    "fits",
    "fitted",
    "fitted_chain",
    "psm_chain",
    "setup_chain",
]

Generation = Literal["classic", "si"]

LONGER = 0.0508
"""Length (m) by which shafts of the S and Si are longer, and the carriage is higher (SAW, joint 3: 0.4826
against 0.4318; roll of a large needle driver: 0.4670 against 0.4162).
"""
_NUMBERS = "42"
"""First digits of the numbers of the S's and Si's instruments."""

_PSM = (
    {"lower": -2.964, "upper": 2.964, "effort": 17.0845},
    {"lower": -1.265, "upper": 1.301, "effort": 17.0845},
    {"lower": 0.0, "upper": 0.290, "effort": 40.9063},
)
PSM_JOINTS = tuple(
    replace(joint, d=joint.d - (LONGER if joint.kind == "prismatic" else 0.0), **its)
    for joint, its in zip(psm.ARM_JOINTS, _PSM, strict=True)
)
"""The joints of the arm itself, before an instrument of its own."""

_ECM = (
    {"lower": -2.964, "upper": 2.964, "effort": 17.0845},
    {"lower": -1.10, "upper": 1.04, "effort": 34.0845},
    {"lower": 0.001, "upper": 0.259, "effort": 70.900},
    {"lower": -1.54, "upper": 1.54, "effort": 6.81923},
)
ECM_JOINTS = tuple(replace(joint, **its) for joint, its in zip(ecm.JOINTS, _ECM, strict=True))


def fits(tool: Instrument) -> bool:
    """Return whether an instrument is of the S and Si."""
    return tool.number.startswith(_NUMBERS)


def psm_chain(tool: Instrument) -> SerialChain:
    """Return the kinematics of a PSM with an instrument of the S and Si."""
    return SerialChain(PSM_JOINTS + tool.joints, tool.tip)


def fitted(tool: Instrument) -> Instrument:
    """Return an instrument of the S and Si as on the Classic's carriage, `LONGER` nearer to the RCM.

    Tip and wrist are at the same places; bodies and looks of carriage and shaft are the Classic's.
    """
    roll, *others = tool.joints
    return replace(tool, joints=(replace(roll, d=roll.d - LONGER), *others))


def fitted_chain(tool: Instrument) -> SerialChain:
    """Return the kinematics of a PSM with an instrument from `fitted`: those of `psm_chain`."""
    on_carriage = tuple(
        replace(joint, d=classic.d) for joint, classic in zip(PSM_JOINTS, psm.ARM_JOINTS, strict=True)
    )
    return SerialChain(on_carriage + tool.joints, tool.tip)


SIMULATED: Mapping[CartArm, tuple[float, ...]] = {
    "PSM1": (0.21713328162535497, -0.28985294982172416, -1.296300785720703, -1.081429816020683),
    "PSM2": (0.19430774368524248, 0.2521927675957645, 1.463079476018301, 0.8695928416300226),
    "PSM3": (
        0.2806527579034114,
        1.6766721211508346,
        0.048778656425950806,
        1.471882438882154,
        0.43725492343646566,
    ),
    "ECM": (0.3079020566881523, 1.1432499826443978, -1.9844024129709243, 0.790592362875),
}
"""Positions of the setup joints in the dVRK's simulation (SAW, simulated_position)."""

_COLUMN: Mapping[CartArm, tuple[float, float, float]] = {
    "PSM1": (-0.2019, -0.0757, pi),
    "PSM2": (0.2019, -0.0757, 0.0),
    "PSM3": (0.0, -0.2776, -pi / 2),
    "ECM": (0.0, 0.1262, pi / 2),
}
"""Where each lift stands on the cart: x, y (m) and rotation about z (SAW, world_origin_to_SUJ)."""

_LINKS: Mapping[CartArm, tuple[tuple[float, float], ...]] = {
    "PSM1": ((0.0, 0.1471), (0.0, 0.6654), (0.4572, 0.1397), (0.4572, -0.1301)),
    "PSM2": ((0.0, 0.1471), (0.0, 0.6654), (0.4572, 0.1397), (0.4572, -0.1301)),
    "PSM3": ((0.0, 0.0455), (0.0, 0.5887), (0.3429, -0.2667), (0.4572, 0.1397), (0.4572, -0.1864)),
    "ECM": ((0.0, 0.1471), (0.0, 0.5861), (0.3302, 0.1397), (0.3302, 0.0549)),
}
"""Length and height (m) by joint, all of which stand vertical (SAW): the lift, then what turns."""

_MOUNTS: Mapping[CartArm, tuple[float, float]] = {
    "PSM1": (0.0490, radians(-45.0)),
    "PSM2": (0.0490, radians(-45.0)),
    "PSM3": (0.0483, radians(-15.0)),
    "ECM": (0.1352, radians(-70.0)),
}
"""Length (m) and tilt of the mount after the last joint (SAW, passive rows)."""

_TO_RCM = 0.8343
"""Distance (m) of the RCM from the mount (SAW, SUJ_tip_to_tool_origin)."""


@cache
def setup_chain(arm: CartArm) -> SerialChain:
    """Return the kinematics of the setup joint that carries `arm`, from the cart to `<arm>_base`, its RCM.

    PSM3 has five joints, the others four; no ranges are published.
    """
    x, y, turn = _COLUMN[arm]
    base = Joint("", "revolute", 0.0, 0.0, 0.0, turn, 0.0, 0.0).transform(0.0)
    base[:2, 3] = x, y
    length, tilt = _MOUNTS[arm]
    tip = (
        Joint("", "revolute", pi / 2, length, 0.0, tilt, 0.0, 0.0).transform(0.0)
        @ Joint("", "revolute", -pi / 2, 0.0, 0.0, 0.0, 0.0, 0.0).transform(0.0)
        @ Joint("", "revolute", 0.0, _TO_RCM, 0.0, -pi / 2, 0.0, 0.0).transform(0.0)
    )
    joints = tuple(
        Joint(f"SUJ_{arm}_J{i}", "revolute" if i else "prismatic", 0.0, a, d, 0.0, -inf, inf)
        for i, (a, d) in enumerate(_LINKS[arm])
    )
    return SerialChain(joints, tip, base)
