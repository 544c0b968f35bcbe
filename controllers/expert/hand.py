"""One hand of the expert: it leads a tip along straight lines, and a jaw.

On a line the tip moves with least jerk: with s = t/T the share 10 s^3 - 15 s^4 + 6 s^5 of the way is done
(Flash and Hogan, 1985), and of the rotation. What is still missing at the end, by the measured pose, is added
to the command step by step. SI units, poses (x, y, z, qx, qy, qz, qw) in the world.
"""

from __future__ import annotations

from enum import IntEnum
from math import sqrt

import numpy as np

from hub.participant import Record, array, choice, flag, integer, number
from robots import rotation
from robots.dvrk.cart import inverse_pose
from robots.dvrk.crtk import base_frame
from robots.dvrk.instruments import Jaw
from robots.serial_chain import SerialChain
from schemas.ros import Header, JointState, Point, Pose, PoseStamped, Quaternion
from schemas.vectors import Vector

__all__ = ["Hand", "HandState", "Phase", "Role", "framed", "pose_of"]

_ACCELERATION, _TURN = 1.0, 12.0
"""Of a line: largest acceleration, m/s^2 and rad/s^2."""
_SPEED, _SPIN = 0.12, 2.5
"""Largest speed, m/s and rad/s; the joints may do 0.2 m/s and 1.6 rad/s (robots.dvrk.psm)."""
_PEAK_SPEED, _PEAK_ACCELERATION = 1.875, 5.774
"""Of a way of 1 in a time of 1."""
_LEAST = 0.05
"""Shortest line, s."""
_SETTLING, _MOST = 0.06, 4.0e-3
"""Time constant (s) with which what is missing is added, and the most of it, m."""
_ACCURATE, _SETTLED = 0.2e-3, 0.05
"""m and s: a tip has settled that has been so near to the end of its line for so long. A tip that only passes
there goes on by 1 mm.
"""


class Phase(IntEnum):
    """What a hand does."""

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


class Role(IntEnum):
    """What a hand does with a thing."""

    ALONE = 0
    """It takes the thing and puts it down."""
    GIVER = 1
    """It takes the thing and gives it to the other hand."""
    TAKER = 2
    """It takes the thing from the other hand and puts it down."""


class HandState(Record):
    """All of one hand that changes."""

    phase = choice(Phase.IDLE)
    role = choice(Role.ALONE)
    thing = integer(-1)
    """Index of the object that it is after or carries; -1: none."""
    place = array(3)
    """Where the middle of that object is to be put, m."""
    start = array(7)
    goal = array(7)
    grasp = array(7)
    """Pose of the tip where it takes hold."""
    opening = number()
    """Of the jaw before it closes, rad."""
    leans = flag()
    """Whether the thing has to be put upright, and the fingers do not point down."""
    up = array(3)
    """Its axis that is to be up then, in its own frame."""
    upright = array(4)
    """Orientation of the tip that is planned for that."""
    turns = integer()
    """How often the hand has turned to bring it there."""
    duration = number()
    """Of the line from `start` to `goal`, s."""
    elapsed = number()
    """s since the line began."""
    waited = number()
    """s since then that the line is done."""
    settled = number()
    """s for which the tip has been where it was sent."""
    unheld = number()
    """s for which nothing has held the thing."""
    correction = array(3)
    """Added to the commanded position, m."""


class Hand:
    """One arm: its line, its jaw and what is measured of them."""

    def __init__(self, arm: str, base: Vector, chain: SerialChain, jaw: Jaw) -> None:
        """Take the arm's name, its base in the world, shape (4, 4), its kinematics and its jaw."""
        self.arm, self.base, self.chain, self.jaw = arm, base, chain, jaw
        self.number = float(arm[-1])
        """As `held_by` has it."""
        self.period = 0.0
        """s."""
        self.state = HandState()
        self._into_base = inverse_pose(base)
        self.measured = np.zeros(7)
        """Pose of the tip in the world."""
        self.angle = 0.0
        """Of the jaw, rad."""
        self.roll = 0.0
        """Of the shaft, measured, rad."""
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
        """Take that the arm's base is at `base`, shape (4, 4), in the world."""
        self.base, self._into_base = base, inverse_pose(base)

    def sense(self, tip: Vector, angle: float) -> None:
        """Take what is measured: the tip in its base frame, shape (7,), and the jaw's angle, rad."""
        self.measured[:] = pose_of(self.base @ framed(tip))
        self.angle = angle

    def stay(self) -> None:
        """Let the line end where the tip is."""
        self.state.start[:] = self.state.goal[:] = self.measured
        self.state.duration = self.state.elapsed = 0.0

    def go(self, goal: Vector, share: float = 1.0) -> None:
        """Begin a line from where the tip was last sent to `goal`, shape (7,), at a share of the speed."""
        state = self.state
        state.start[:] = self.line()
        state.goal[:] = goal
        way = float(np.linalg.norm(goal[:3] - state.start[:3]))
        angle = float(np.linalg.norm(rotation.log(self._turn())))
        state.duration = max(
            _LEAST,
            _PEAK_SPEED * way / (share * _SPEED),
            _PEAK_SPEED * angle / _SPIN,
            sqrt(_PEAK_ACCELERATION * way / _ACCELERATION),
            sqrt(_PEAK_ACCELERATION * angle / _TURN),
        )
        state.elapsed = state.settled = 0.0

    def move_jaw(self, angle: float) -> None:
        """Tell the jaw to go to an angle, rad."""
        self._angles.append(angle)

    def line(self) -> Vector:
        """Return the pose on the line, shape (7,)."""
        state = self.state
        if self.has_arrived:
            return state.goal.copy()
        s = state.elapsed / state.duration
        share = s**3 * (10.0 + s * (6.0 * s - 15.0))
        position = state.start[:3] + share * (state.goal[:3] - state.start[:3])
        turn = rotation.exp(share * rotation.log(self._turn()))
        return np.concatenate([position, rotation.product(turn, state.start[3:])])

    def _turn(self) -> Vector:
        return rotation.product(self.state.goal[3:], rotation.conjugate(self.state.start[3:]))

    def advance(self, *, settle: bool) -> PoseStamped:
        """Go on by a period and return the command to the tip, in its base frame.

        `settle`: whether what is missing at the end of a line is added.
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
        x, y, z, i, j, k, w = pose_of(self._into_base @ framed(wanted)).tolist()
        pose = Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=i, y=j, z=k, w=w))
        return PoseStamped(header=Header(frame_id=base_frame(self.arm)), pose=pose)

    def jaw_commands(self) -> tuple[JointState, ...]:
        """Return the commands to the jaw in this step, and forget them."""
        commands = tuple(JointState(position=np.array([angle])) for angle in self._angles)
        self._angles.clear()
        return commands


def framed(pose: Vector) -> Vector:
    """Return a pose, shape (7,), as a homogeneous transform, shape (4, 4)."""
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = rotation.matrix(pose[3:]), pose[:3]
    return frame


def pose_of(frame: Vector) -> Vector:
    """Return a homogeneous transform, shape (4, 4), as a pose, shape (7,)."""
    return np.concatenate([frame[:3, 3], rotation.from_matrix(frame)])
