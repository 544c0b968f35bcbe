"""The setup joints (SUJ) of the patient cart, Classic: braked links that carry PSM1 to PSM3 and the ECM.

Each carries its arm's remote centre of motion (RCM): a lift, then revolute joints, of which all but `tilt`
stand vertical. The cart's frame has z up and y from the column towards the patient. Sources: SAW =
jhu-dvrk/sawIntuitiveResearchKit (commit 9e535e68), share/arm/suj-simulated.json (right angles and 0.7853
taken as exact); dvrk_model = jhu-dvrk/dvrk_model (commit 70998aa), urdf/Classic/SUJ.urdf.xacro; dvrk_env =
WPI-AIM/dvrk_env (commit 7759cad), dvrk_description/suj/suj.xacro. SI units, radians.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from math import inf, pi
from typing import Literal

from robots.serial_chain import Joint, SerialChain
from schemas.vectors import Vector

__all__ = [
    "CART_MASS",
    "JOINT_NAMES",
    "MASSES",
    "SIMULATED",
    "CartArm",
    "DrivenArm",
    "base_pose",
    "chain",
    "joint_names",
]

CartArm = Literal["PSM1", "PSM2", "PSM3", "ECM"]
"""The arms on the cart."""
DrivenArm = CartArm | Literal["MTML", "MTMR"]
"""The arms with drives, masters included."""

JOINT_NAMES = ("lift", "shoulder", "elbow", "wrist", "tilt", "mount")

SIMULATED: Mapping[CartArm, tuple[float, ...]] = {
    "PSM1": (0.0007, -0.5892, -0.8590, -0.6241, -0.2479, -0.4422),
    "PSM2": (0.0628, 0.0913, 1.9073, -0.1297, 0.4351, 0.0353),
    "PSM3": (-0.0261, -1.5892, 1.3076, 0.6994, 0.1361, 0.3359),
    "ECM": (0.6647, 0.5782, -1.2662, 3.7818, 0.0, 0.0),
}
"""Positions in the dVRK's simulation (SAW, simulated_position): three arms about the endoscope's view."""

CART_MASS = 251.3
"""kg: base and column (dvrk_env, CAD, base_link)."""

_ARM_MASSES = (8.190, 4.285, 3.374, 0.955, 3.171, 0.0)
MASSES: Mapping[CartArm, tuple[float, ...]] = {
    "PSM1": _ARM_MASSES,
    "PSM2": _ARM_MASSES,
    "PSM3": (6.048, 9.214, 3.374, 1.460, 3.171, 0.0),
    "ECM": (8.190, 4.285, 3.374, 3.459, 0.0, 0.0),
}
"""kg of the links that these joints move (dvrk_env, CAD, suj_<arm>_L0 to L4; what mounts the manipulator is
part of the last one). Not measured: 19 to 23 kg an arm, without what balances the lift.
"""

_LIFT = (-0.3798, 0.8425)
"""Range (m) of the lift of PSM1, PSM2 and ECM (dvrk_model). The other joints turn without end there."""
_LIFT_PSM3 = (-0.2858, 0.9365)
"""PSM3's, as high above the floor: the range 0 .. 1.2223 of dvrk_model, counted from SAW's zero (see
docs/decisions/0007).
"""

_COLUMN: Mapping[CartArm, tuple[float, float, float, float]] = {
    "PSM1": (-0.1016, -0.1016, 0.4300, pi),
    "PSM2": (0.1016, -0.1016, 0.4300, 0.0),
    "PSM3": (0.0, 0.0, 0.1264, pi / 2),
    "ECM": (0.0, 0.0, 0.4300, pi / 2),
}
"""Where each lift stands on the cart: x, y, z (m) and rotation about z (SAW, world_origin_to_SUJ)."""

_LENGTHS: Mapping[CartArm, tuple[float, float, float]] = {
    "PSM1": (0.4166, 0.4318, -0.1302),
    "PSM2": (0.4166, 0.4318, -0.1302),
    "PSM3": (0.3404, 0.5842, 0.2571),
    "ECM": (0.4166, 0.4318, -0.3459),
}
"""What differs between the arms (m): height of the shoulder, length of the upper arm, height of the wrist
over the elbow (SAW).
"""


def _joints(arm: CartArm) -> tuple[Joint, ...]:
    height, upper_arm, drop = _LENGTHS[arm]
    vertical = (
        Joint("lift", "prismatic", 0.0, 0.0896, 0.0, 0.0, *(_LIFT_PSM3 if arm == "PSM3" else _LIFT)),
        Joint("shoulder", "revolute", 0.0, 0.0, height, 0.0, -inf, inf),
        Joint("elbow", "revolute", 0.0, upper_arm, 0.1429, 0.0, -inf, inf),
        Joint("wrist", "revolute", 0.0, 0.4318, drop, pi / 2, -inf, inf),
    )
    if arm == "ECM":  # the last two rows of its table do not move
        return (
            *vertical,
            Joint("tilt", "revolute", -pi / 4, 0.0, 0.0, pi / 2, 0.0, 0.0),
            Joint("mount", "revolute", 0.0, -0.0667, 0.0, 0.0, 0.0, 0.0),
        )
    return (
        *vertical,
        Joint("tilt", "revolute", pi / 2, 0.0, 0.4089, 0.0, -inf, inf),
        Joint("mount", "revolute", -pi / 2, 0.0, -0.1029, -pi / 2, -inf, inf),
    )


@cache
def chain(arm: CartArm) -> SerialChain:
    """Return the kinematics of the setup joint that carries `arm`, from the cart to `<arm>_base`, its RCM."""
    x, y, z, turn = _COLUMN[arm]
    base = Joint("", "revolute", 0.0, 0.0, 0.0, turn, 0.0, 0.0).transform(0.0)
    base[:3, 3] = x, y, z
    tip = Joint("", "revolute", 0.0, 0.0, 0.0, -pi / 2, 0.0, 0.0).transform(0.0)
    # SAW, SUJ_tip_to_tool_origin
    tip[:3, 3] = (0.6126, 0.0, 0.1016) if arm == "ECM" else (0.4864, 0.0, 0.1524)
    return SerialChain(_joints(arm), tip, base)


def base_pose(arm: CartArm, q: Vector) -> Vector:
    """Return the pose of the RCM frame `<arm>_base` in the cart's frame, shape (..., 4, 4).

    Setup joint positions have shape (..., 6).
    """
    return chain(arm).forward(q)


def joint_names(arm: CartArm) -> tuple[str, ...]:
    """Return the names of the setup joints that carry `arm` as the real system has them: `SUJ_PSM1_J0`."""
    return tuple(f"SUJ_{arm}_J{index}" for index in range(len(JOINT_NAMES)))
