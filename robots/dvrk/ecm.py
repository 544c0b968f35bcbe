"""The endoscope camera manipulator (ECM) of the da Vinci Research Kit, Classic: numbers with their sources.

Source: SAW = jhu-dvrk/sawIntuitiveResearchKit (commit 9e535e68). The base frame has its origin in the remote
centre of motion (RCM), the endoscope goes in along -z. SI units, radians.
"""

from __future__ import annotations

from math import cos, pi, radians, sin
from typing import Literal

import numpy as np

from robots.serial_chain import Joint, SerialChain, jerk_limit
from schemas.vectors import Vector

__all__ = ["ENDOSCOPE_PITCH", "HOME", "JOINTS", "JOINT_NAMES", "Endoscope", "TipFrame", "chain", "tip"]

Endoscope = Literal["straight", "up", "down"]
"""Where an endoscope looks: along its shaft, or 30 degrees up or down."""

_TURN, _SLIDE = radians(30.0), 0.060
"""Velocities of the trajectories, rad/s and m/s (SAW core/components/code/mtsIntuitiveResearchKitECM.cpp,
v_max).
"""
_TURN_ACCELERATION, _SLIDE_ACCELERATION = radians(90.0), 0.060
"""rad/s^2 and m/s^2 (same file, a_max)."""
_TURNING = (_TURN_ACCELERATION, jerk_limit(_TURN_ACCELERATION))
_SLIDING = (_SLIDE_ACCELERATION, jerk_limit(_SLIDE_ACCELERATION))

JOINTS = (
    Joint("yaw", "revolute", pi / 2, 0.0, 0.0, pi / 2, -1.5708, 1.5708, _TURN, 26.93208, *_TURNING),
    Joint("pitch", "revolute", -pi / 2, 0.0, 0.0, -pi / 2, -0.76794, 1.1344, _TURN, 26.93208, *_TURNING),
    Joint("insertion", "prismatic", pi / 2, 0.0, -0.3822, 0.0, 0.0, 0.255, _SLIDE, 80.6589483, *_SLIDING),
    Joint("roll", "revolute", 0.0, 0.0, 0.3829, 0.0, -1.552, 1.552, _TURN, 0.87658808, *_TURNING),
)
"""Modified DH, range and effort limit from SAW share/kinematic/ECM.json (1.5708 of the table taken as pi/2).
"""

JOINT_NAMES = tuple(joint.name for joint in JOINTS)

HOME = (0.0, 0.0, 0.12, 0.0)
"""Where the real controller homes a simulated arm (SAW mtsIntuitiveResearchKitECM.cpp): straight, insertion
0.12 m.
"""

ENDOSCOPE_PITCH = {"straight": 0.0, "up": radians(-30.0), "down": radians(30.0)}
"""Rotation of the tip about its x axis by the kind of endoscope, rad (SAW mtsIntuitiveResearchKitECM.cpp)."""


TipFrame = Literal["kinematic", "view"]
"""How the camera frame stands about the shaft: as the roll link, or as the surgeon sees it: x to the left, y
up, z ahead. See docs/decisions/0013.
"""

_VIEW_IN_ROLL = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""A quarter turn about the shaft (SAW, commit 0210eb1a, same file, set_endoscope_type), to which the
endoscope's own pitch is added.
"""


def tip(endoscope: Endoscope, frame: TipFrame = "kinematic") -> Vector:
    """Return the pose of the camera frame in the frame of the roll link, shape (4, 4)."""
    angle = ENDOSCOPE_PITCH[endoscope]
    pose = np.eye(4)
    pose[1:3, 1:3] = [[cos(angle), -sin(angle)], [sin(angle), cos(angle)]]
    if frame == "view":
        pose[:3, :3] = _VIEW_IN_ROLL @ pose[:3, :3]
    return pose


def chain(
    endoscope: Endoscope = "straight", frame: TipFrame = "kinematic", joints: tuple[Joint, ...] = JOINTS
) -> SerialChain:
    """Return the kinematics of the arm, from the RCM frame `ECM_base` to the camera frame."""
    return SerialChain(joints, tip(endoscope, frame))
