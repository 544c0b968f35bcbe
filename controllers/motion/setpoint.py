"""The setpoint of n joints: it goes where it is told to, and neither its position nor its velocity ever
jumps.

Two sets of limits. A *move* is a time-optimal trajectory within velocity, acceleration and jerk (Ruckig:
Berscheid and Kroeger, "Jerk-limited Real-time Trajectory Generation with Arbitrary Target States", RSS 2021),
all joints arriving together. *Following* a stream of goals, and *braking*, keep to the velocity and to
`FOLLOWING_ACCELERATION` times the acceleration: trajectory limits are set for comfort, and a hand or a visual
servo that is followed no faster would be followed too late.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from ruckig import InputParameter, Result, Ruckig, RuckigError, Trajectory

from controllers.motion.limits import FOLLOWING_ACCELERATION, STREAM_GAP
from robots.serial_chain import Joint
from schemas.vectors import Vector

__all__ = ["Activity", "Setpoint"]

_LOOKS = 200
"""Points at which a trajectory is compared with the ranges: with 2 s a point each 10 ms, between which 1.57
rad/s^2 add 20 urad at most.
"""
_PASSING = 1e-9
"""rad and m by which rounding may carry a trajectory past a joint's range. What hides between two looks is
clipped as it comes.
"""
_ROWS = 8
_SCALARS = 8


class Activity(IntEnum):
    """What the setpoint is about."""

    HOLD = 0
    FOLLOW = 1
    MOVE = 2
    BRAKE = 3
    DRIFT = 4


class Setpoint:
    """Positions and velocities of n joints, advanced step by step. All that changes is in `state`."""

    def __init__(self, joints: tuple[Joint, ...]) -> None:
        """Take the joints, whose range, velocity, acceleration and jerk are kept to."""
        n = len(joints)
        self._n = n
        self._lower, self._upper, self._velocity, self._acceleration, self._jerk = np.array(
            [(joint.lower, joint.upper, joint.velocity, joint.acceleration, joint.jerk) for joint in joints]
        ).T.copy()
        self._most = FOLLOWING_ACCELERATION * self._acceleration
        self.state = np.zeros(_ROWS * n + _SCALARS)
        rows = self.state[: _ROWS * n].reshape(_ROWS, n)
        self.position, self.velocity, self._acceleration_now, self.goal, self._arrival = rows[:5]
        self._origin = rows[5:]  # position, velocity and acceleration where the trajectory starts
        scalars = self.state[_ROWS * n :]
        self._activity, self._elapsed, self._since, self._waiting, self._pending, self._stated = (
            scalars[i : i + 1] for i in range(6)
        )
        self._ratio = scalars[6:]  # of velocity, and of acceleration and jerk
        self._ruckig, self._trajectory = Ruckig(n), Trajectory(n)

    @property
    def activity(self) -> Activity:
        """What the setpoint is about now."""
        return Activity(int(self._activity[0]))

    @property
    def is_moving(self) -> bool:
        """Whether a move is under way, or waits for the setpoint to come to rest."""
        return self.activity is Activity.MOVE or bool(self._pending[0])

    def reset(self, position: Vector) -> None:
        """Stand at `position`, shape (n,), or as near to it as the ranges allow."""
        self.position[:] = _clip(position, self._lower, self._upper)
        self.goal[:] = self.position
        self._rest()

    def follow(self, goal: Vector, h: float, velocity: Vector | None = None) -> None:
        """Go to `goal`, shape (n,), inside the ranges, the newest of a stream or a single one; `h` is the
        step (s).

        Of a stream the setpoint reaches each goal when the next is due, in a straight line from the last one,
        so it neither lags by more than that nor stops in between. Where the sender states the velocity at the
        goal, shape (n,), it gets there in a cubic.
        """
        streaming = self.activity is Activity.FOLLOW and self._since[0] <= STREAM_GAP
        interval = max(float(self._since[0]), h) if streaming else h
        self._stated[0] = velocity is not None
        if velocity is None and streaming:
            velocity = (goal - self.goal) / interval
        self._arrival[:] = 0.0 if velocity is None else _clip(velocity, -self._velocity, self._velocity)
        self.goal[:] = goal
        self._waiting[0], self._since[0], self._pending[0] = interval, 0.0, 0.0
        self._activity[0] = Activity.FOLLOW

    def drift(self, velocity: Vector) -> None:
        """Go on with `velocity`, shape (n,), for as long as it is told again within `STREAM_GAP`; else, and
        at a range's end, come to rest.
        """
        self._arrival[:] = _clip(velocity, -self._velocity, self._velocity)
        self._since[0], self._pending[0] = 0.0, 0.0
        self._activity[0] = Activity.DRIFT

    def move(self, goal: Vector, ratio: Vector) -> None:
        """Start a trajectory from the present state to rest at `goal`, shape (n,), inside the ranges.

        `ratio`, shape (2,), scales the velocity, and the acceleration with the jerk. If the setpoint is too
        fast to stay inside the ranges on the way, it brakes first.
        """
        self.goal[:] = goal
        self._ratio[:] = ratio
        self._origin[:] = self.position, self.velocity, self._acceleration_now
        if self._plan():
            self._activity[0], self._elapsed[0], self._pending[0] = Activity.MOVE, 0.0, 0.0
        else:
            self._activity[0], self._pending[0] = Activity.BRAKE, 1.0

    def brake(self) -> None:
        """Come to rest as quickly as following allows, and stay there."""
        self._activity[0], self._pending[0] = Activity.BRAKE, 0.0
        self._acceleration_now[:] = 0.0

    def step(self, h: float) -> bool:
        """Advance by `h` seconds; return whether a move has arrived, or braking has come to rest, in this
        step.
        """
        activity = self.activity
        if activity is Activity.HOLD:
            return False
        if activity is Activity.MOVE:
            return self._go_on(h)
        if activity is Activity.FOLLOW:
            self._follow(h)
            return False
        if activity is Activity.DRIFT and self._since[0] <= STREAM_GAP:
            most_down, most_up = self._fastest(
                np.array([self.position - self._lower, self._upper - self.position]), h
            )
            self._steer(self._arrival, most_down, most_up, h)
            return False
        return self._slow_down(h)

    def restored(self) -> None:
        """Bring what is not in `state` up to it."""
        if self.activity is Activity.MOVE:
            self._plan()

    def _rest(self) -> None:
        self.velocity[:] = self._acceleration_now[:] = 0.0
        self._activity[0], self._pending[0] = Activity.HOLD, 0.0

    def _plan(self) -> bool:
        """Compute the trajectory from `_origin` to `goal`; return whether there is one that stays inside the
        ranges.
        """
        request, (faster, harder) = InputParameter(self._n), self._ratio.tolist()
        request.current_position, request.current_velocity, request.current_acceleration = self._origin
        request.target_position = self.goal
        request.max_velocity, request.max_acceleration, request.max_jerk = (
            faster * self._velocity,
            harder * self._acceleration,
            harder * self._jerk,
        )
        try:
            result = self._ruckig.calculate(request, self._trajectory)
        except RuckigError:
            if not self.velocity.any():
                raise
            return False
        return result in (Result.Working, Result.Finished) and self._stays_inside()

    def _stays_inside(self) -> bool:
        """Look along the trajectory, unless it starts from rest: Ruckig's `position_extrema` leaves out its
        braking at the start.
        """
        if not self._origin[1:].any():
            return True
        times = np.linspace(0.0, self._trajectory.duration, _LOOKS).tolist()
        way = np.array([self._trajectory.at_time(time)[0] for time in times])
        return bool((way >= self._lower - _PASSING).all() and (way <= self._upper + _PASSING).all())

    def _go_on(self, h: float) -> bool:
        self._elapsed[0] += h
        elapsed = float(self._elapsed[0])
        if elapsed >= self._trajectory.duration:
            self.position[:] = self.goal
            self._rest()
            return True
        position, self.velocity[:], self._acceleration_now[:] = self._trajectory.at_time(elapsed)
        self.position[:] = _clip(np.array(position), self._lower, self._upper)
        return False

    def _follow(self, h: float) -> None:
        wait = max(float(self._waiting[0]), h)
        # from where a setpoint that is in time would be now
        away = self.goal - self.position - wait * self._arrival
        most, most_down, most_up = self._fastest(
            np.array([np.abs(away), self.position - self._lower, self._upper - self.position]), h
        )
        faster = self._bend(wait, h) if self._stated[0] else away / wait
        self._steer(self._arrival + _clip(faster, -most, most), most_down, most_up, h)
        self._waiting[0] = max(wait - h, 0.0)
        if not self._waiting[0]:
            self._arrival[:] = self._stated[0] = 0.0

    def _bend(self, wait: float, h: float) -> Vector:
        """Return by how much the next step's velocity, shape (n,), is over that of arrival, on the cubic that
        arrives after `wait` seconds.
        """
        mean = (self.goal - self.position) / wait
        now, then = self.velocity - mean, self._arrival - mean  # the cubic less the straight line
        share = h / wait
        return mean + now - share * (2.0 * now + then) + share * share * (now + then) - self._arrival

    def _steer(self, wanted: Vector, most_down: Vector, most_up: Vector, h: float) -> None:
        """Take a step with the velocity nearest to `wanted`, shape (n,), that the limits and the way left to
        either side allow.
        """
        room = h * self._most
        wanted = _clip(
            _clip(wanted, -self._velocity, self._velocity), self.velocity - room, self.velocity + room
        )
        self.velocity[:] = _clip(wanted, -most_down, most_up)
        self.position += h * self.velocity
        self.position[:] = _clip(self.position, self._lower, self._upper)
        self._acceleration_now[:] = 0.0
        self._since[0] += h

    def _fastest(self, distance: Vector, h: float) -> Vector:
        """Return the largest velocity, shape (..., n), from which steps of `h` come to rest within
        `distance`, shape (..., n).

        With the velocity falling by A h a step from n A h, m = floor(n) + 1 steps go A h^2 (m n - m (m - 1) /
        2) far; solved for n.
        """
        room = h * self._most
        steps = np.maximum(distance, 0.0) / (h * room)
        whole = np.floor((np.sqrt(1.0 + 8.0 * steps) - 1.0) / 2.0)
        return room * (steps / (whole + 1.0) + whole / 2.0)

    def _slow_down(self, h: float) -> bool:
        room = h * self._most
        self.velocity -= _clip(self.velocity, -room, room)
        self.position += h * self.velocity
        self.position[:] = _clip(self.position, self._lower, self._upper)
        if self.velocity.any():
            return False
        if self._pending[0]:
            self._acceleration_now[:] = 0.0
            self.move(self.goal.copy(), self._ratio.copy())
            return False
        self.goal[:] = self.position
        self._rest()
        return True


def _clip(value: Vector, lower: Vector, upper: Vector) -> Vector:
    return np.minimum(np.maximum(value, lower), upper)  # a third of the cost of np.clip
