"""Kinematics of a curved needle between the pads of a rolling needle driver.

Its joints are the arm's six and the roll of the needle.

The needle is held with its tangent along the wrist yaw axis, its tip to the side of the tip frame's +x. With
the roller at 0 its arc goes out ahead of the jaw; at -90 degrees its plane is across the jaw, so that a turn
to the right (clockwise, seen along the shaft) drives it on: forehand; at +90 degrees it is across the other
way: backhand. Its own frame has the origin in the arc's centre, x to the middle of the wire and z normal to
its plane, so that a turn about z drives it on.

Seven joints for six coordinates: of the rolls on a lattice over the range, taken from which the
joints are farthest from their limits, as the sum of ((q - middle) / half range)^2 counts it (Liegeois,
"Automatic supervisory control of the configuration and behavior of multibody mechanisms", IEEE Transactions
on Systems, Man, and Cybernetics 7(12), 1977).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi, radians

import numpy as np

from robots.dvrk import inverse as six
from robots.dvrk import psm
from robots.dvrk.end_effectors.rolling_jaw import RollingJaw
from robots.dvrk.instruments import Instrument
from robots.serial_chain import SerialChain
from robots.transform import inverse_transform
from schemas.errors import MotionError
from schemas.vectors import Vector

__all__ = ["Needle", "chain", "inverse", "rolls", "solutions"]

_STEP = radians(15.0)
"""Largest step of the lattice of rolls."""


@dataclass(frozen=True)
class Needle:
    """A wire bent to an arc, as in unina-icaros/dvrk-vrep (dVRK-suturing.ttt)."""

    radius: float = 11.44e-3
    """Radius of the centre line, m."""
    arc: float = radians(180.9)
    """Arc from end to end, rad; a positive turn about z drives the tip ahead."""


def chain(tool: Instrument, needle: Needle, held: float) -> SerialChain:
    """Return the kinematics from `<arm>_base` to the frame of `needle`, along seven joints.

    Raises MotionError if `tool` has no rolling jaw or the needle does not reach so far.
    """
    jaw = tool.end_effector
    if not isinstance(jaw, RollingJaw):
        raise MotionError(f"'{tool.name}' does not roll a needle; take ROLLING_NEEDLE_DRIVER")
    if not 0.0 <= held <= needle.arc:
        raise MotionError(f"a needle of {needle.arc:.4g} rad cannot be held {held:.4g} rad behind its tip")
    arm = psm.chain(tool).joints
    wrist = replace(arm[-1], theta=arm[-1].theta + pi / 2.0)  # x ahead, along the fingers
    roll = replace(jaw.roller, alpha=pi, a=jaw.distance)
    along = needle.arc / 2.0 - held
    radial, tangent = (
        np.array([np.cos(along), np.sin(along), 0.0]),
        np.array([-np.sin(along), np.cos(along), 0.0]),
    )
    tip = np.eye(4)
    # the roll's x to the arc's centre, y normal to its plane, z along the wire
    tip[:3, :3] = np.array([-radial, [0.0, 0.0, 1.0], tangent])
    tip[:3, 3] = tip[:3, :3] @ (-needle.radius * radial)
    return SerialChain([*arm[:-1], wrist, roll], tip)


def rolls(seven: SerialChain) -> Vector:
    """Return the lattice of rolls, shape (m,), rad: from limit to limit, with 0 in it."""
    lower, upper = float(seven.lower[-1]), float(seven.upper[-1])
    half = int(np.ceil(max(-lower, upper) / _STEP))
    return np.linspace(lower, upper, 2 * half + 1)


def solutions(tool: Instrument, seven: SerialChain, pose: Vector, roll: Vector) -> Vector:
    """Return the arm's joint positions, shape (4, ..., m, 6), at which the needle has `pose`.

    The pose has shape (..., 4, 4); there is one solution for each `roll`, shape (m,).

    In range or not, one set for each branch of `robots.dvrk.inverse.branches`.
    """
    grip = seven.joints[-1].transform(0.0)
    turns = np.zeros((len(roll), 4, 4))
    turns[:, 0, 0] = turns[:, 1, 1] = np.cos(roll)
    turns[:, 1, 0] = np.sin(roll)
    turns[:, 0, 1] = -turns[:, 1, 0]
    turns[:, 2, 2] = turns[:, 3, 3] = 1.0
    ahead = np.eye(4)  # the wrist yaw link of the seven joints in that of the arm's six
    ahead[:2, :2] = [[0.0, -1.0], [1.0, 0.0]]
    six_joints = psm.chain(tool)
    to_tip = inverse_transform(ahead @ grip @ turns @ seven.tip) @ six_joints.tip  # (m, 4, 4)
    return six.branches(six_joints, pose[..., None, :, :] @ to_tip)


def inverse(tool: Instrument, seven: SerialChain, pose: Vector) -> Vector:
    """Return joint positions, shape (..., 7), in range, at which the needle has `pose`, shape (..., 4, 4).

    Of several solutions the criterion of this module selects one.

    Raises MotionError if a pose is not reachable with any roll.
    """
    lattice = rolls(seven)
    found = solutions(tool, seven, pose, lattice)  # (4, ..., m, 6)
    q = np.concatenate([found, np.broadcast_to(lattice[:, None], (*found.shape[:-1], 1))], axis=-1)
    q = np.moveaxis(q, 0, -3).reshape(*np.shape(pose)[:-2], -1, 7)  # (..., 4 m, 7)
    middle, half = (seven.upper + seven.lower) / 2.0, (seven.upper - seven.lower) / 2.0
    away = (q - middle) / half
    cost = np.where((np.abs(away) <= 1.0).all(axis=-1), (away**2).sum(axis=-1), np.inf)  # (..., 4 m)
    if not np.isfinite(cost.min(axis=-1)).all():
        raise MotionError(
            f"the needle cannot be brought there: with none of {len(lattice)} rolls all joints of the arm are"
            " in range"
        )
    return np.take_along_axis(q, cost.argmin(axis=-1)[..., None, None], axis=-2)[..., 0, :]
