"""Closed-form inverse kinematics of the arms whose shaft passes a remote centre of motion (RCM): PSM and ECM.

The shaft turns about the RCM, the base frame's origin, by yaw and pitch, slides by insertion and rolls. With
d its direction and r the signed way from the RCM to the point where the wrist begins, all in the base frame:

PSM. The wrist yaw axis z6 passes o6, both known from the goal. The wrist pitch axis z5 is perpendicular to z6
and to the shaft, and x5 points from it to the wrist yaw axis, a away. As the RCM lies on the shaft, the plane
normal to z5 through the shaft holds RCM, o6 and z6: so x5 is, up to its sign, the part of o6 perpendicular to
z6, and o5 = o6 - a x5 = r d. Two signs of x5 and two of r: four branches. Where the yaw axis passes the RCM
any x5 will do: the wrist yaw of `near` stays. Where the pitch axis passes it (insertion 15.6 mm with the
instruments of the Classic) any d perpendicular to z5 will do: the shaft stays as near to that of `near` as
the wrist pitch allows.

ECM, and a PSM with a hand in place of the wrist. Four joints cannot take any pose. As on the real ECM the
position decides yaw, pitch and insertion, and the roll is what comes nearest to the orientation asked for;
what remains is accepted up to `ORIENTATION_TOLERANCE` and refused beyond.

Of the branches inside all joint ranges the one nearest to `near` is taken, by the time that each joint would
need at its velocity limit.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import degrees, pi, radians

import numpy as np
from numpy.typing import NDArray

from robots.dvrk import ecm, mtm, psm
from robots.dvrk.mtm_inverse import inverse_mtm
from robots.limits import ANGLE_TOLERANCE, distinct
from robots.serial_chain import Joint, SerialChain, compiled
from robots.transform import inverse_transform
from robots.vector3 import cross
from schemas.errors import MotionError
from schemas.vectors import Vector

__all__ = ["ORIENTATION_TOLERANCE", "branches", "inverse"]

ORIENTATION_TOLERANCE = radians(45.0)
"""Angle between the ECM's goal and the nearest orientation at the position, rad.

The real controller (jhu-dvrk/sawIntuitiveResearchKit, robManipulatorECM.cpp) has no bound: programs command
positions and keep the orientation. dvrk_arm_test.py of jhu-dvrk/dvrk_python moves the ECM by 40 mm along x
and y from an insertion of 120 mm, for which 25 degrees remain. Goals in another frame or with axes in another
order are about 90 degrees away and refused.
"""

_RIGID = 1e-6
"""Largest entry of R^T R - 1 taken for rounding, of a pose written with 7 digits."""
_FAR = 1e3
"""m: no arm reaches so far, and the squares of what is much further are no numbers."""
_POINT = 1e-9
"""m: two axes that pass each other so closely meet."""
_RCM_ROWS = tuple((joint.kind, joint.alpha, joint.a, joint.theta) for joint in psm.ARM_JOINTS)
_BOTTOM, _ONE = np.array([0.0, 0.0, 0.0, 1.0]), np.eye(3)
"""Whose products are those of a cross product: the first three less the last three."""
_TURN = 2.0 * pi
_BRANCH_SIGNS = (
    np.array([1.0, -1.0, 1.0, -1.0])[:, None, None],
    np.array([1.0, 1.0, -1.0, -1.0])[:, None, None],
)
"""Signs of x5 and of the shaft's direction, in the four branches of a PSM."""
_WRIST_ALPHAS = (0.0, -pi / 2, -pi / 2)
_CHAINS = 64
"""Whose constants are kept: some times the arms of a session."""


@dataclass(frozen=True, eq=False)
class _Form:
    """What the closed form takes from a chain of n joints."""

    from_tip: Vector
    """Pose of the last link in the tip's frame, shape (4, 4)."""
    theta: Vector
    """DH angles of the joints after the insertion."""
    lowest: Vector
    highest: Vector
    """Ends of the joint ranges, widened by `ANGLE_TOLERANCE`, shape (n,)."""
    middle: Vector
    """Middle of the joint ranges, shape (n,)."""
    numbers: tuple[Vector, Vector, Vector, Vector]
    """What the compiled function takes, with the offsets of roll, insertion and wrist yaw."""


@lru_cache(maxsize=_CHAINS)
def _form(chain: SerialChain) -> _Form:
    _require(chain, ecm.JOINTS[3:] if len(chain.joints) == len(ecm.JOINTS) else chain.joints[3:])
    from_tip, theta = inverse_transform(chain.tip), np.array([joint.theta for joint in chain.joints[3:]])
    lowest, highest = chain.lower - ANGLE_TOLERANCE, chain.upper + ANGLE_TOLERANCE
    middle = (chain.lower + chain.upper) / 2
    offsets = np.array([chain.joints[3].d, chain.joints[2].d, chain.joints[-1].a])
    limits = np.array([lowest, highest, middle, chain.tolerance, chain.velocity])
    numbers = np.ascontiguousarray(from_tip), theta, offsets, limits
    return _Form(from_tip, theta, lowest, highest, middle, numbers)


def inverse(chain: SerialChain, pose: Vector, near: Vector) -> Vector:
    """Return joint positions, shape (..., n), inside the joint ranges, at which the tip has `pose`.

        joints = inverse(psm, tips, near=home)     # (..., 4, 4), m -> (..., 6), rad and m

    Args:
        chain: a PSM with a wrist of three joints or none, an ECM, or a master (`robots.dvrk.mtm_inverse`).
        pose: of the tip in the chain's base frame, shape (..., 4, 4).
        near: joint positions that decide between solutions, shape (n,) or (..., n).

    Raises:
        MotionError: wrong shape, not finite, no rigid transform, or not reachable; the message names the
            joints, the positions they would need and their ranges, for the first of many poses that fails.
    """
    if len(chain.joints) == len(mtm.JOINT_NAMES):
        poses, start = _goals(chain, pose, near)
        rows = zip(poses, np.broadcast_to(start, (len(poses), len(chain.joints))), strict=True)
        found = np.array([inverse_mtm(chain, one, at) for one, at in rows])
        return found.reshape(*np.shape(pose)[:-2], -1)
    form = _form(chain)
    if compiled is not None:
        found = compiled.inverse(chain.numbers, form.numbers, pose, near)
        if found is not None:
            return found
    n = len(chain.joints)
    poses, start = _goals(chain, pose, near)
    ends = poses @ form.from_tip
    if n == len(ecm.JOINTS):
        branches = _branches_without_wrist(chain, poses[:, :3, 3], ends[:, :3, :3])
    else:
        branches = _psm_branches(chain, ends, start)
    branches = _unwind(chain, branches, start)
    excess = np.maximum(chain.lower - branches, branches - chain.upper)  # (branches, N, n)
    cost = np.where(
        np.logical_and.reduce(excess <= chain.tolerance, axis=-1),
        np.add.reduce(((branches - start) / chain.velocity) ** 2, axis=-1),
        np.inf,
    )
    best, each = cost.argmin(axis=0), np.arange(len(poses))
    reached = np.isfinite(cost[best, each])
    if _any_true(~reached):
        raise _unreachable(chain, branches[:, reached.argmin()], reached.argmin(), len(poses))
    q = np.minimum(np.maximum(branches[best, each], chain.lower), chain.upper)
    if n == len(ecm.JOINTS):
        _check_orientation(chain.frames(q)[:, -1], poses)
    return q.reshape(*np.shape(pose)[:-2], n)


def _goals(chain: SerialChain, pose: Vector, near: Vector) -> tuple[Vector, Vector]:
    """Return poses, (N, 4, 4), and where they are looked for, (N, n) or (1, n), once they make sense."""
    n, many = len(chain.joints), np.shape(pose)[:-2]
    if np.shape(pose)[-2:] != (4, 4):
        raise MotionError(f"pose of shape {np.shape(pose)}, expected (..., 4, 4), a homogeneous transform")
    if np.shape(near)[-1:] != (n,) or np.shape(near)[:-1] not in ((), many):
        names = ", ".join(joint.name for joint in chain.joints)
        allowed = " or ".join(dict.fromkeys([f"({n},)", str((*many, n))]))
        raise MotionError(f"positions `near` of shape {np.shape(near)}, expected {allowed}: {names}")
    poses = np.asarray(pose, np.float64).reshape(-1, 4, 4)
    start = np.asarray(near, np.float64).reshape(-1, n)  # (N, n), or (1, n) for all
    if _any_true(~np.isfinite(poses)) or _any_true(~np.isfinite(start)):
        raise MotionError("a pose or a joint position that is not finite cannot be reached")
    if _any_true(np.abs(poses[:, :3, 3]) > _FAR):
        raise MotionError(f"a position more than {_FAR:g} m away from the base cannot be reached")
    if (i := _first_unrigid(poses)) is not None:
        where = f" {i}" if len(poses) > 1 else ""
        raise MotionError(
            f"pose{where} is no rigid transform: {poses[i].tolist()}; allowed are a rotation matrix, a"
            " position and (0, 0, 0, 1) below"
        )
    return poses, start


def _any_true(flags: NDArray[np.bool_]) -> bool:
    return 1 in flags.tobytes()  # a quarter of the cost of flags.any()


def _first_unrigid(poses: Vector) -> int | None:
    """Return the index of the first of `poses`, shape (N, 4, 4), that is no rigid transform."""
    rotation = poses[:, :3, :3]
    away = np.abs(rotation.swapaxes(-1, -2) @ rotation - _ONE) > _RIGID
    below = np.abs(poses[:, 3] - _BOTTOM) > _RIGID
    mirrored = _dot_rows(cross(rotation[:, :, 0], rotation[:, :, 1]), rotation[:, :, 2]) < 0.0
    if not (_any_true(away) or _any_true(below) or _any_true(mirrored)):
        return None
    return int((away.any(axis=(-2, -1)) | below.any(axis=-1) | mirrored).argmax())


def branches(chain: SerialChain, pose: Vector) -> Vector:
    """Return the joint positions of all four branches, shape (4, ..., 6), in range or not.

    Revolute ones are within half a turn of 0.

    Where a singular pose leaves a joint free, it is at 0. In the last two the shaft points away from the
    wrist: their insertion is below 0 by as much as the wrist is away, and never in range.

    Args:
        chain: a PSM with a wrist of three joints.
        pose: of the tip in the chain's base frame, shape (..., 4, 4), finite.
    """
    _require(chain, chain.joints[3:])
    ends = (pose @ _form(chain).from_tip).reshape(-1, 4, 4)
    near = np.zeros((1, len(chain.joints)))
    return _unwind(chain, _psm_branches(chain, ends, near), near).reshape(
        4, *pose.shape[:-2], len(chain.joints)
    )


def _require(chain: SerialChain, wrist: tuple[Joint, ...]) -> None:
    """Refuse a chain that the closed form is not for."""
    rows = tuple((joint.kind, joint.alpha, joint.a, joint.theta) for joint in chain.joints[:3])
    alphas = tuple(joint.alpha for joint in wrist)
    if (
        rows != _RCM_ROWS
        or alphas != _WRIST_ALPHAS[: len(wrist)]
        or len(chain.joints) != 3 + len(wrist)
        or len(wrist) not in (1, 3)
    ):
        names = ", ".join(joint.name for joint in chain.joints)
        raise MotionError(
            f"no closed form for the joints {names}: it is for a PSM with roll, wrist pitch and wrist yaw or"
            " with roll alone, and for the ECM"
        )


def _branches_without_wrist(chain: SerialChain, position: Vector, rotation: Vector) -> Vector:
    """Return the joint positions, shape (2, N, 4), with the tip at `position`, shape (N, 3).

    The tip is on the axis of the last link.

    `rotation`, shape (N, 3, 3), is the one asked for of the last link.
    """
    distance = _length(position)
    outwards = np.where(distance > _POINT, position / np.maximum(distance, _POINT), rotation[:, :, 2])
    shaft = outwards * _BRANCH_SIGNS[0][:2]  # (2, N, 3)
    q = np.empty((2, len(position), 4))
    x3, y3 = _shaft_joints(chain, shaft, _dot_rows(shaft, position) - chain.tip[2, 3], q)
    # The turn about the shaft that brings x4, y4 nearest to the goal's x and y (least squares of the
    # matrices' difference).
    x, y = rotation[:, :, 0], rotation[:, :, 1]
    q[..., 3] = (
        np.arctan2(_dot_rows(x, y3) - _dot_rows(y, x3), _dot_rows(x, x3) + _dot_rows(y, y3))
        - chain.joints[3].theta
    )
    return q


def _psm_branches(chain: SerialChain, ends: Vector, near: Vector) -> Vector:
    """Return the joint positions, shape (4, N, 6), of poses of the wrist yaw link, shape (N, 4, 4)."""
    yaw = chain.joints[5]
    x6, y6, yaw_axis, centre = ends[:, :3, 0], ends[:, :3, 1], ends[:, :3, 2], ends[:, :3, 3]
    across = centre - _dot_rows(centre, yaw_axis)[:, None] * yaw_axis
    distance = _length(across)
    if _any_true(distance <= _POINT):
        angle = near[:, 5:] + yaw.theta
        kept = np.cos(angle) * x6 - np.sin(angle) * y6  # x5 at the wrist yaw of `near`
        x5 = np.where(distance > _POINT, across / np.maximum(distance, _POINT), kept)
    else:
        x5 = across / distance
    x5 = x5 * _BRANCH_SIGNS[0]  # (4, N, 3)
    z5 = cross(x5, yaw_axis)
    wrist = centre - yaw.a * x5
    shaft = _shaft_direction(chain, wrist, x5, z5, near) * _BRANCH_SIGNS[1]
    q = np.empty((4, len(ends), 6))
    x3, y3 = _shaft_joints(chain, shaft, _dot_rows(shaft, wrist), q)
    np.arctan2(-_dot_rows(z5, x3), _dot_rows(z5, y3), out=q[..., 3])
    np.arctan2(-_dot_rows(x5, shaft), _dot_rows(x5, cross(z5, shaft)), out=q[..., 4])
    np.arctan2(-_dot_rows(y6, x5), _dot_rows(x6, x5), out=q[..., 5])
    q[..., 3:] -= _form(chain).theta
    return q


def _shaft_direction(chain: SerialChain, wrist: Vector, x5: Vector, z5: Vector, near: Vector) -> Vector:
    """Return the direction of the shaft, shape (4, N, 3), which passes through RCM and wrist.

    It is perpendicular to the wrist pitch axis z5.
    """
    distance = _length(wrist)
    shaft = wrist - _dot_rows(wrist, z5)[..., None] * z5
    if _any_true(distance <= _POINT):
        yaw, pitch = near[:, 0], near[:, 1]
        old = np.stack([np.cos(pitch) * np.sin(yaw), -np.sin(pitch), -np.cos(pitch) * np.cos(yaw)], axis=-1)
        y5 = cross(z5, x5)
        joint = chain.joints[4]
        bend = np.clip(np.arctan2(-_dot_rows(old, y5), _dot_rows(old, x5)), joint.lower, joint.upper)[
            ..., None
        ]
        shaft = np.where(distance > _POINT, shaft, np.cos(bend) * x5 - np.sin(bend) * y5)
    return shaft / _length(shaft)


def _shaft_joints(chain: SerialChain, shaft: Vector, depth: Vector, q: Vector) -> tuple[Vector, Vector]:
    """Write yaw, pitch and insertion into `q`; return the axes x3 and y3 of the insertion link.

    Each has shape (branches, N, 3).

    The shaft's direction is (cos q2 sin q1, -sin q2, -cos q2 cos q1).
    """
    x, y, z = shaft[..., 0], shaft[..., 1], shaft[..., 2]
    np.arctan2(x, -z, out=q[..., 0])
    np.arctan2(-y, np.hypot(x, z), out=q[..., 1])
    q[..., 2] = depth - chain.joints[3].d - chain.joints[2].d
    sines, cosines = np.sin(q[..., :2]), np.cos(q[..., :2])
    s1, c1, s2, c2 = sines[..., 0], cosines[..., 0], sines[..., 1], cosines[..., 1]
    x3 = np.empty_like(shaft)
    x3[..., 0], x3[..., 1], x3[..., 2] = -s1 * s2, -c2, c1 * s2
    return x3, cross(shaft, x3)


def _length(a: Vector) -> Vector:
    """Return the length of vectors, shape (..., 1)."""
    return np.sqrt(np.add.reduce(a * a, axis=-1, keepdims=True))


def _dot_rows(a: Vector, b: Vector) -> Vector:
    product: Vector = np.vecdot(a, b)
    return product


def _unwind(chain: SerialChain, branches: Vector, near: Vector) -> Vector:
    """Return revolute positions, by whole turns nearest to `near`.

    If that is out of range, nearest to the middle of the range.
    """
    form = _form(chain)
    nearest = branches + _TURN * np.rint((near - branches) / _TURN)
    central = branches + _TURN * np.rint((form.middle - branches) / _TURN)
    unwound = np.where((nearest >= form.lowest) & (nearest <= form.highest), nearest, central)
    for joint in chain.prismatic:
        unwound[..., joint] = branches[..., joint]
    return unwound


def _unreachable(chain: SerialChain, branches: Vector, index: np.intp, count: int) -> MotionError:
    """Return which joints prevent the branch that is least beyond the joint ranges, shape (branches, n)."""
    beyond = np.maximum(np.maximum(chain.lower - branches, branches - chain.upper), 0.0) / (
        chain.upper - chain.lower
    )
    q = branches[beyond.sum(axis=-1).argmin()]
    reasons = "; ".join(chain.out_of_range(q))
    return MotionError(f"pose{f' {index}' if count > 1 else ''} cannot be reached: {reasons}")


def _check_orientation(reached: Vector, asked: Vector) -> None:
    """Refuse goals whose orientation four joints miss by more than `ORIENTATION_TOLERANCE`."""
    away = reached[:, :3, :3] - asked[:, :3, :3]
    difference = np.sqrt(np.add.reduce(away * away, axis=(-2, -1)))
    angles: NDArray[np.float64] = 2.0 * np.arcsin(np.minimum(difference / np.sqrt(8.0), 1.0))
    worst = int(angles.argmax())
    if angles[worst] > ORIENTATION_TOLERANCE + ANGLE_TOLERANCE:
        away, allowed = distinct(degrees(angles[worst]), degrees(ORIENTATION_TOLERANCE), digits=3)
        where = f" {worst}" if len(asked) > 1 else ""
        raise MotionError(
            f"pose{where} cannot be reached: four joints leave its orientation {away} degrees away at"
            f" this position, allowed are {allowed}; the shaft points away from the remote centre of motion"
        )
