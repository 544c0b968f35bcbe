"""The patient-side manipulator (PSM) of the da Vinci Research Kit, Classic: numbers with their sources.

Source: SAW = jhu-dvrk/sawIntuitiveResearchKit, release 2.3 tree of April 2026 (commit 9e535e68). The base
frame has its origin in the remote centre of motion (RCM), the instrument goes in along -z. SI units, radians.
"""

from __future__ import annotations

from math import pi, radians

from robots.dvrk.instruments import Instrument
from robots.serial_chain import Joint, SerialChain, jerk_limit

__all__ = ["ARM_JOINTS", "HOME", "JOINT_NAMES", "chain", "home"]

_RCM_TO_CARRIAGE = 0.4318
"""Distance (m) of the instrument carriage from the RCM at insertion 0 (SAW share/kinematic/PSM.json, offset
of joint 3).
"""

_TURN, _SLIDE = radians(90.0), 0.2
"""Limits of the trajectories (SAW core/components/code/mtsIntuitiveResearchKitPSM.cpp, v_max and a_max):
rad/s and rad/s^2; m/s and m/s^2.
"""

ARM_JOINTS = (
    Joint(
        "yaw", "revolute", pi / 2, 0.0, 0.0, pi / 2, -1.588, 1.588, _TURN, 3.316101, _TURN, jerk_limit(_TURN)
    ),
    Joint(
        "pitch",
        "revolute",
        -pi / 2,
        0.0,
        0.0,
        -pi / 2,
        -0.925025,
        0.925025,
        _TURN,
        3.316101,
        _TURN,
        jerk_limit(_TURN),
    ),
    Joint(
        "insertion",
        "prismatic",
        pi / 2,
        0.0,
        -_RCM_TO_CARRIAGE,
        0.0,
        0.0,
        0.240,
        _SLIDE,
        9.877926,
        _SLIDE,
        jerk_limit(_SLIDE),
    ),
)
"""The joints of the arm itself: modified DH, range and effort limit from SAW share/kinematic/PSM.json (1.5708
taken as pi/2).
"""

JOINT_NAMES = ("yaw", "pitch", "insertion", "roll", "wrist_pitch", "wrist_yaw")
"""Names as in SAW share/kinematic/PSM.json and share/tool/*.json."""

HOME = (0.0, 0.0, 0.12, 0.0, 0.0, 0.0)
"""Where the real controller homes a simulated arm (SAW mtsIntuitiveResearchKitPSM.cpp): straight, insertion
0.12 m.
"""


def home(instrument: Instrument) -> tuple[float, ...]:
    """Return `HOME` for the joints of the arm with `instrument`: what is beyond stands at 0."""
    joints = len(ARM_JOINTS) + len(instrument.joints)
    return (*HOME, *(0.0,) * joints)[:joints]


def chain(instrument: Instrument) -> SerialChain:
    """Return the kinematics of the arm with `instrument`, from the RCM frame `<arm>_base` to its tip."""
    return SerialChain(ARM_JOINTS + instrument.joints, instrument.tip)
