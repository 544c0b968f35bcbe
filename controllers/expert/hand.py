"""A robot hand: leads the tip of an arm along straight lines, and its jaw.

On a line the tip moves with least jerk: at s = t/T the fraction 10 s^3 - 15 s^4 + 6 s^5 of the translation
and the rotation is done (Flash and Hogan, 1985). At the end of a line the measured error is integrated into
the command. SI units, poses (x, y, z, qx, qy, qz, qw) in the world.
"""

from __future__ import annotations

from enum import IntEnum
from math import sqrt

import numpy as np

from controllers.least_jerk import PEAK_ACCELERATION, PEAK_SPEED, least_jerk
from hub.participant import Record, array, choice, flag, integer, number
from robots import rotation
from robots.dvrk.crtk import base_frame
from robots.dvrk.instruments import Jaw
from robots.serial_chain import SerialChain
from robots.transform import inverse_transform, matrix_to_pose, pose_to_matrix
from schemas.ros import Header, JointState, Point, Pose, PoseStamped, Quaternion
from schemas.vectors import Vector

__all__ = ["HandPhase", "HandRole", "HandState", "RobotHand"]

_ACCELERATION, _TURN = 1.0, 12.0
"""Largest acceleration on a line, m/s^2 and rad/s^2."""
_SPEED, _SPIN = 0.12, 2.5
"""Largest speed, m/s and rad/s; the joints may do 0.2 m/s and 1.6 rad/s (robots.dvrk.psm)."""
_LEAST = 0.05
"""Shortest duration of a line, s."""
_SETTLING, _MOST = 0.06, 4.0e-3
"""Time constant (s) of the correction at the end of a line, and its limit, m."""
_ACCURATE, _SETTLED = 0.2e-3, 0.05
"""A tip has settled after 0.05 s within 0.2 mm of the end of its line. A tip in passing overshoots by 1 mm.
"""


class HandPhase(IntEnum):
    """Phase of a hand."""

    IDLE = 0
    RISE = 1
    ACROSS = 2
    DESCEND = 3
    CLOSE = 4
    LIFT = 5
    CARRY = 6
    ALIGN = 7
    LOWER = 8
    OPEN = 9
    RETREAT = 10
    OFFER = 11
    TAKE = 12
    REACH = 13
    TURN = 14


class HandRole(IntEnum):
    """Role of a hand in the transfer of an object."""

    ALONE = 0
    """Takes the object and puts the object down."""
    GIVER = 1
    """Takes the object and gives the object to the second hand."""
    TAKER = 2
    """Takes the object from the first hand and puts the object down."""


class HandState(Record):
    """State of a hand."""

    phase = choice(HandPhase.IDLE)
    role = choice(HandRole.ALONE)
    object_index = integer(-1)
    """Index of the targeted or carried object; -1: none."""
    place = array(3)
    """Target of the object's middle, m."""
    start = array(7)
    goal = array(7)
    grasp = array(7)
    """Pose of the tip at the grasp."""
    opening = number()
    """Jaw opening before the grasp, rad."""
    leans = flag()
    """Whether the object must be put upright, with fingers that do not point down."""
    up = array(3)
    """Axis of the object to be upright, in the frame of the object."""
    upright = array(4)
    """Planned orientation of the tip with the object upright."""
    turns = integer()
    """Number of turns made to put the object upright."""
    duration = number()
    """Duration of the line from `start` to `goal`, s."""
    elapsed = number()
    """Time since the line began, s."""
    waited = number()
    """Time since the line ended, s."""
    settled = number()
    """Time of the tip at the end of its line, s."""
    unheld = number()
    """Time of the object without a holder, s."""
    correction = array(3)
    """Offset added to the commanded position, m."""


class RobotHand:
    """An arm's line and jaw, with their measurements."""

    def __init__(self, arm: str, base: Vector, chain: SerialChain, jaw: Jaw) -> None:
        """`base`: transform from the arm's base to the world, shape (4, 4)."""
        self.arm, self.base, self.chain, self.jaw = arm, base, chain, jaw
        self.number = float(arm[-1])
        """Number of the arm, as in `held_by`."""
        self.period = 0.0
        """Period of steps, s."""
        self.state = HandState()
        self._into_base = inverse_transform(base)
        self.measured = np.zeros(7)
        """Measured pose of the tip in the world."""
        self.angle = 0.0
        """Measured jaw opening, rad."""
        self.roll = 0.0
        """Measured roll of the shaft, rad."""
        self._angles: list[float] = []

    @property
    def has_arrived(self) -> bool:
        """Whether the line is done."""
        return self.state.elapsed >= self.state.duration

    @property
    def has_settled(self) -> bool:
        """Whether the tip rests at the end of its line."""
        return self.state.settled >= _SETTLED

    @property
    def error(self) -> float:
        """Distance of the measured tip from the end of its line, m."""
        off = self.state.goal[:3] - self.measured[:3]
        return sqrt(float(off @ off))

    @property
    def lag(self) -> float:
        """Distance of the measured tip from its line, m."""
        off = self.line()[:3] - self.measured[:3]
        return sqrt(float(off @ off))

    def stand(self, base: Vector) -> None:
        """Set the transform from the arm's base to the world, shape (4, 4)."""
        self.base, self._into_base = base, inverse_transform(base)

    def sense(self, tip: Vector, angle: float) -> None:
        """Store measurements: the tip's pose in the arm's base, shape (7,), and the jaw opening, rad."""
        self.measured[:] = matrix_to_pose(self.base @ pose_to_matrix(tip))
        self.angle = angle

    def stay(self) -> None:
        """End the line at the measured pose of the tip."""
        self.state.start[:] = self.state.goal[:] = self.measured
        self.state.duration = self.state.elapsed = 0.0

    def go(self, goal: Vector, share: float = 1.0) -> None:
        """Begin a line from the last commanded pose to `goal`, shape (7,), at a fraction of the speed."""
        state = self.state
        state.start[:] = self.line()
        state.goal[:] = goal
        way = float(np.linalg.norm(goal[:3] - state.start[:3]))
        angle = float(np.linalg.norm(rotation.log(self._turn())))
        state.duration = max(
            _LEAST,
            PEAK_SPEED * way / (share * _SPEED),
            PEAK_SPEED * angle / _SPIN,
            sqrt(PEAK_ACCELERATION * way / _ACCELERATION),
            sqrt(PEAK_ACCELERATION * angle / _TURN),
        )
        state.elapsed = state.settled = 0.0

    def move_jaw(self, angle: float) -> None:
        """Command an angle of the jaw, rad."""
        self._angles.append(angle)

    def line(self) -> Vector:
        """Return the pose on the line, shape (7,)."""
        state = self.state
        if self.has_arrived:
            return state.goal.copy()
        share = least_jerk(state.elapsed / state.duration)
        position = state.start[:3] + share * (state.goal[:3] - state.start[:3])
        turn = rotation.exp(share * rotation.log(self._turn()))
        return np.concatenate([position, rotation.product(turn, state.start[3:])])

    def _turn(self) -> Vector:
        return rotation.product(self.state.goal[3:], rotation.conjugate(self.state.start[3:]))

    def advance(self, *, settle: bool) -> PoseStamped:
        """Advance by a period and return the command to the tip, in the arm's base frame.

        `settle`: integrate the measured error at the end of a line into the command.
        """
        state, h = self.state, self.period
        if self.has_arrived:
            state.waited += h
            state.settled = state.settled + h if self.error < _ACCURATE else 0.0
        state.elapsed = min(state.elapsed + h, state.duration)
        if settle and self.has_arrived:
            state.correction += (state.goal[:3] - self.measured[:3]) * (h / _SETTLING)
            np.clip(state.correction, -_MOST, _MOST, out=state.correction)
        wanted = self.line()
        wanted[:3] += state.correction
        x, y, z, i, j, k, w = matrix_to_pose(self._into_base @ pose_to_matrix(wanted)).tolist()
        pose = Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=i, y=j, z=k, w=w))
        return PoseStamped(header=Header(frame_id=base_frame(self.arm)), pose=pose)

    def jaw_commands(self) -> tuple[JointState, ...]:
        """Return the commands to the jaw in this step, and clear the list."""
        commands = tuple(JointState(position=np.array([angle])) for angle in self._angles)
        self._angles.clear()
        return commands
