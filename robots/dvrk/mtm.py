"""The master tool manipulators (MTML, MTMR) of the da Vinci Research Kit: numbers with their sources.

Source: SAW = jhu-dvrk/sawIntuitiveResearchKit (commit 9e535e68), share/kinematic/MTML.json and MTMR.json
(1.5708 of the tables taken as pi/2), velocities and accelerations from
core/components/code/mtsIntuitiveResearchKitMTM.cpp. SI units, radians.
"""

from __future__ import annotations

from math import cos, pi, radians, sin
from typing import Literal

import numpy as np

from robots.serial_chain import Joint, SerialChain, jerk_limit
from schemas.vectors import Vector

__all__ = [
    "ACTUATOR_TO_JOINT",
    "BASE",
    "DISPLAY_FRAME",
    "GRIPPER_OPEN",
    "HOME",
    "JOINT_NAMES",
    "MtmName",
    "chain",
]

MtmName = Literal["MTML", "MTMR"]

_TURN, _TURN_ACCELERATION = radians(90.0), radians(45.0)
_ROLL = radians(360.0)
"""rad/s, and rad/s^2 of the acceleration."""
_TURNING = (_TURN_ACCELERATION, jerk_limit(_TURN_ACCELERATION))

_RANGES = {
    "MTML": ((-0.698132, 1.13446), (-0.261799, 1.13446), (-3.5779, 1.6580)),
    "MTMR": ((-1.13446, 0.698132), (-0.31416, 1.13446), (-1.6580, 3.5779)),
}
"""Numbers of outer yaw, shoulder pitch and wrist platform, different left and right."""

ACTUATOR_TO_JOINT = np.eye(7)
"""Joint positions of actuator positions, shape (7, 7): the elbow hangs on a parallelogram, the platform on
both.
"""
ACTUATOR_TO_JOINT[2, 1], ACTUATOR_TO_JOINT[3, 1:3] = -1.0, (0.6697, -0.6697)


def _base(side: float) -> Vector:
    tilt = radians(30.0)
    return np.array(
        [
            [-1.0, 0.0, 0.0, side],
            [0.0, cos(tilt), sin(tilt), 0.400],
            [0.0, sin(tilt), -cos(tilt), 0.475],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


BASE = {"MTML": _base(0.180), "MTMR": _base(-0.180)}
"""Pose of `<arm>_base` in the frame of the stereo viewer (HRSV), shape (4, 4) (SAW
share/system/system-full-system-simulated.json).

The viewer's frame is that of a camera's view: x to the left, y up, z ahead, 60 degrees down. The base stands
upright: x to the right, y ahead, z up.
"""
DISPLAY_FRAME = "HRSV"
"""`frame_id` of the stereo viewer (same file)."""

HOME = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""Joint positions after homing (SAW mtsIntuitiveResearchKitMTM.cpp, SetGoalHomingArm)."""
GRIPPER_OPEN = radians(60.0)
"""Largest opening of the gripper (SAW mtsIntuitiveResearchKit.h, GripperMax)."""


def _joints(arm: MtmName) -> tuple[Joint, ...]:
    """Return the rows of standard DH form."""
    yaw, shoulder, platform = _RANGES[arm]
    return (
        Joint("outer_yaw", "revolute", pi / 2, 0.0, 0.0, -pi / 2, *yaw, _TURN, 1.86082986, *_TURNING),
        Joint(
            "shoulder_pitch", "revolute", 0.0, 0.2794, 0.0, -pi / 2, *shoulder, _TURN, 3.21661506, *_TURNING
        ),
        Joint(
            "elbow_pitch",
            "revolute",
            -pi / 2,
            0.3645,
            0.0,
            pi / 2,
            -0.872665,
            0.610865,
            _TURN,
            1.95978284,
            *_TURNING,
        ),
        Joint(
            "wrist_platform", "revolute", pi / 2, 0.0, 0.1506, 0.0, *platform, _TURN, 0.30901338, *_TURNING
        ),
        Joint(
            "wrist_pitch", "revolute", -pi / 2, 0.0, 0.0, 0.0, -1.6580, 3.2288, _TURN, 0.09684378, *_TURNING
        ),
        Joint(
            "wrist_yaw",
            "revolute",
            pi / 2,
            0.0,
            0.0,
            -pi / 2,
            -0.785398,
            0.785398,
            _TURN,
            0.09684378,
            *_TURNING,
        ),
        Joint(
            "wrist_roll",
            "revolute",
            0.0,
            0.0,
            0.0,
            pi / 2,
            -8.37758,
            7.85398,
            _ROLL,
            0.02287592,
            _ROLL,
            jerk_limit(_ROLL),
        ),
    )


def chain(arm: MtmName) -> SerialChain:
    """Return the kinematics of the arm, from `<arm>_base`, its first DH frame, to the gripper."""
    return SerialChain.from_standard(_joints(arm), np.eye(4))


JOINT_NAMES = tuple(joint.name for joint in _joints("MTML"))
