"""Inverse kinematics of arms with the same kinematics in one call, ahead of their `servo_cp`.

A call for three arms costs what one for one arm does. Joint positions are those of a call for each arm, to
the bit. They are taken by a command only if its pose, the arm's base frame and its setpoint are those that
they were found for; so commands, faults and refusals are what they would be without this.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from robots.dvrk.inverse import inverse
from schemas.errors import MotionError
from schemas.ros import PoseStamped
from schemas.vectors import Vector

if TYPE_CHECKING:
    from controllers.motion.arm import Arm
    from hub.participant import Inputs

__all__ = ["PoseAhead", "alike", "solve_ahead"]


class PoseAhead:
    """A pose of one arm's tip, and the joint positions that are found for it."""

    def __init__(self, message: PoseStamped, base: Vector, near: Vector, tip: Vector) -> None:
        """Take what joint positions depend on.

        Args:
            message: the command.
            base: the arm's base frame in its reference, shape (4, 4).
            near: the setpoint, shape (n,), which decides between solutions.
            tip: the pose in the arm's base frame, shape (4, 4).
        """
        self._message, self._base, self._near = message, base.tobytes(), near.tobytes()
        self.near, self.tip = near, tip
        self.goal = near
        """The joint positions, shape (n,), once they are found."""

    def is_for(self, message: PoseStamped, base: Vector, near: Vector) -> bool:
        """Say whether joint positions depend on these; arguments as those of the constructor."""
        return message is self._message and near.tobytes() == self._near and base.tobytes() == self._base


def alike(arms: Iterable[Arm]) -> list[list[Arm]]:
    """Return the arms that share their kinematics with others, as with instruments of equal lengths."""
    groups: dict[object, list[Arm]] = {}
    for arm in arms:
        chain = arm.chain
        groups.setdefault((chain.joints, chain.basis.tobytes(), chain.tip.tobytes()), []).append(arm)
    return [group for group in groups.values() if len(group) > 1]


def solve_ahead(arms: Sequence[Arm], inputs: Inputs) -> None:
    """Find the joint positions for the `servo_cp` that two or more of `arms`, which are alike, receive.

    If one of the poses is refused, each arm finds its own, and says so.
    """
    asked = [(arm, ahead) for arm in arms if (ahead := arm.prepare(inputs)) is not None]
    if len(asked) < 2:
        return
    tips = np.array([ahead.tip for _, ahead in asked])
    try:
        goals = inverse(arms[0].chain, tips, np.array([ahead.near for _, ahead in asked]))
    except MotionError:
        return
    for (arm, ahead), goal in zip(asked, goals, strict=True):
        ahead.goal = goal
        arm.accept(ahead)
