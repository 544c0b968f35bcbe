"""Inverse kinematics of a master: seven joints, of which the platform's is chosen.

The axes of platform and wrist meet in the gripper's origin, so that its position decides yaw, shoulder and
elbow. For a platform angle the wrist is a ZYZ rotation: with N the goal's orientation beyond the platform,

    N = Rz(q5) Ry(q6 - pi/2) Rz(q7 + pi/2).

The platform goes by q6 cos(q5) from where it is, as on the real controller (jhu-dvrk/sawIntuitiveResearchKit,
mtsIntuitiveResearchKitMTM.cpp, InverseKinematics), which brings the wrist yaw back to its middle; where that
leaves a joint out of its range, to where the wrist yaw is 0.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import acos, asin, atan2, cos, hypot, pi, sin

import numpy as np

from robots.serial_chain import SerialChain
from schemas.errors import MotionError
from schemas.vectors import Vector

__all__ = ["inverse_mtm", "wrist_angles"]

_TURN = 2.0 * pi
_PLATFORM, _PITCH, _YAW, _ROLL = range(3, 7)
"""Indices of the joints of platform and wrist."""
_UPRIGHT = 1e-6
"""Distance of the roll axis from the platform's below which every platform angle is as good."""
_QUARTER = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""A quarter turn about x: from the platform's frame to that of the wrist pitch."""


def inverse_mtm(chain: SerialChain, pose: Vector, near: Vector) -> Vector:
    """Return joint positions, shape (7,), inside the joint ranges, at which the gripper has `pose`.

    Args:
        chain: of a master.
        pose: of the gripper in `<arm>_base`, shape (4, 4).
        near: joint positions, shape (7,), that decide the platform's angle and the turns of the roll.

    Raises:
        MotionError: not reachable.
    """
    q = np.array(near, np.float64)
    q[:_PLATFORM] = chain.within(_with_arm(chain, q, pose[:3, 3]))[:_PLATFORM]
    forearm = chain.frames(np.where(np.arange(7) < _PLATFORM, q, 0.0))[_PLATFORM, :3, :3]
    refusal: MotionError | None = None
    for platform in _platforms(chain, near, forearm.T @ pose[:3, 2]):
        q[_PLATFORM:] = platform, *wrist_angles(chain, forearm, platform, pose[:3, :3], near)
        try:
            return chain.within(q)
        except MotionError as error:
            refusal = refusal or error
    raise refusal or MotionError("the pose cannot be reached")


def _with_arm(chain: SerialChain, q: Vector, position: Vector) -> Vector:
    """Return `q` with yaw, shoulder and elbow for a position of the gripper, m, shape (3,)."""
    upper, lower, rise = chain.joints[2].a, chain.joints[3].a, chain.joints[3].d
    fore, lift = hypot(lower, rise), atan2(rise, lower)
    x, y, height = position.tolist()
    reach = hypot(x, y)
    share = (upper**2 + fore**2 - reach**2 - height**2) / (2.0 * upper * fore)
    if not abs(share) <= 1.0:
        raise MotionError(
            f"the gripper would be {hypot(reach, height):.3f} m from the shoulder, allowed are"
            f" {abs(upper - fore):.3f} to {upper + fore:.3f}"
        )
    bend = asin(share)
    a, b = upper - fore * sin(bend), fore * cos(bend)
    shoulder = atan2(a * reach + b * height, b * reach - a * height)
    return np.array([atan2(x, -y), shoulder, bend - lift, *q[_PLATFORM:]])


def _platforms(chain: SerialChain, near: Vector, roll_axis: Vector) -> Iterator[float]:
    """Yield platform angles to try; `roll_axis`: of the goal in the forearm's frame, shape (3,)."""
    joint, here = chain.joints[_PLATFORM], float(near[_PLATFORM])
    yield min(max(here + float(near[_YAW]) * cos(float(near[_PITCH])), joint.lower), joint.upper)
    yield here
    if hypot(roll_axis[0], roll_axis[1]) > _UPRIGHT:
        straight = atan2(roll_axis[1], roll_axis[0]) - joint.theta
        angles = [straight + turn * pi for turn in range(-3, 4)]
        yield from sorted(
            (angle for angle in angles if joint.lower <= angle <= joint.upper), key=lambda a: abs(a - here)
        )


def wrist_angles(
    chain: SerialChain, forearm: Vector, platform: float, orientation: Vector, near: Vector
) -> tuple[float, float, float]:
    """Return wrist pitch, yaw and roll for an orientation of the gripper.

    Args:
        chain: of a master.
        forearm: orientation of the platform's frame at platform angle 0 in `<arm>_base`, shape (3, 3).
        platform: its angle, rad.
        orientation: of the gripper in `<arm>_base`, shape (3, 3).
        near: joint positions, shape (7,), for whole turns.
    """
    c, s = cos(platform), sin(platform)
    beyond = (forearm @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ _QUARTER).T @ orientation
    pitch = atan2(-beyond[1, 2], -beyond[0, 2])
    yaw = pi / 2.0 - acos(min(max(float(beyond[2, 2]), -1.0), 1.0))
    roll = atan2(-beyond[2, 1], beyond[2, 0]) - pi / 2.0
    return _unwind(chain, _PITCH, pitch, near), yaw, _unwind(chain, _ROLL, roll, near)


def _unwind(chain: SerialChain, index: int, angle: float, near: Vector) -> float:
    """Return `angle` by whole turns nearest to `near`, or one turn back where that is out of range."""
    joint = chain.joints[index]
    angle += round((float(near[index]) - angle) / _TURN) * _TURN
    if angle > joint.upper:
        return angle - _TURN
    return angle + _TURN if angle < joint.lower else angle
