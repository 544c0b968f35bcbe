"""The setpoint of n joints: follows commands without jumps in position or velocity.

Two sets of limits. A *move* is a time-optimal trajectory within velocity, acceleration and jerk (Ruckig:
Berscheid and Kroeger, "Jerk-limited Real-time Trajectory Generation with Arbitrary Target States", RSS 2021),
all joints arriving together. *Following* a stream of goals, and *braking*, keep to the velocity and to
`FOLLOWING_ACCELERATION` times the acceleration: trajectory limits are set for comfort, too slow for following
a hand or a visual servo.
"""

from __future__ import annotations

import numpy as np
from ruckig import InputParameter, Result, Ruckig, RuckigError, Trajectory

from controllers.motion.following import Followers, clip, fastest, steer
from controllers.motion.setpoint_state import Activity, SetpointState
from robots.serial_chain import Joint
from schemas.vectors import Vector

__all__ = ["FOLLOWING_ACCELERATION", "STREAM_GAP", "Setpoint"]

FOLLOWING_ACCELERATION = 10.0
"""Acceleration of `servo_*` and of braking by `hold`, relative to the acceleration of trajectories.

15.7 rad/s^2 for the PSM's yaw, near the limit of the drive: 3.316 N m against 0.2076 kg m^2 are 16.0 rad/s^2
(docs/decisions/0011).
"""
STREAM_GAP = 0.1
"""s; `servo_*` commands further apart than this are no stream: ten periods of the dVRK's own 100 Hz."""
_EARLY = 1.5
"""A goal of a stream is early if the last goal is still due in more than this number of steps.

Rounding to steps makes a regular stream early by one step.
"""
_LOOKS = 200
"""Number of points of a trajectory compared with the ranges.

In 2 s the points are 10 ms apart; in between 1.57 rad/s^2 add 20 urad at most.
"""
_PASSING = 1e-9
"""Tolerance for rounding of a trajectory past a joint's range, rad and m.

Excess between two points of comparison is clipped in the step.
"""


class Setpoint:
    """Positions and velocities of n joints, advanced step by step."""

    def __init__(self, joints: tuple[Joint, ...]) -> None:
        """Start at zero, with HOLD; range, velocity, acceleration and jerk of the joints are kept to."""
        n = len(joints)
        self._n = n
        self.limit(joints)
        self.state = SetpointState(n=n)
        self.course = self.state.values[: 5 * n].reshape(5, n)
        """The first five parts of `state`: position, velocity, acceleration, goal, velocity at the goal."""
        self.position, self.velocity, self.goal = self.state.position, self.state.velocity, self.state.goal
        self._arrival, self._origin = self.state.arrival, self.state.origin
        self._ruckig, self._trajectory = Ruckig(n), Trajectory(n)

    def limit(self, joints: tuple[Joint, ...]) -> None:
        """Keep to range, velocity, acceleration and jerk of `joints` from now on."""
        self._lower, self._upper, self._velocity, self._acceleration, self._jerk = np.array(
            [(joint.lower, joint.upper, joint.velocity, joint.acceleration, joint.jerk) for joint in joints]
        ).T.copy()
        self._most, self._backwards = FOLLOWING_ACCELERATION * self._acceleration, -self._velocity
        self.limits = np.array([self._lower, self._upper, self._velocity, self._most])
        """Limits of position to either side, velocity, and acceleration while following, shape (4, n)."""

    @property
    def activity(self) -> Activity:
        """Present activity of the setpoint."""
        return self.state.activity

    @property
    def is_moving(self) -> bool:
        """Whether a move is under way, or waits for the setpoint to come to rest."""
        return self.state.activity is Activity.MOVE or self.state.pending

    def reset(self, position: Vector) -> None:
        """Stand at `position`, shape (n,), clipped to the ranges."""
        np.minimum(np.maximum(position, self._lower), self._upper, out=self.position)
        self.goal[:] = self.position
        self._rest()

    def follow(self, goal: Vector, h: float, velocity: Vector | None = None) -> None:
        """Go to a goal inside the ranges, the newest goal of a stream or a single goal.

        In a stream the setpoint reaches each goal when the next is due, in a straight line from the last
        goal, so the lag is one interval and there are no stops. For a goal with a stated velocity the path is
        a cubic. An early goal, before the last goal was due, keeps the last goal's time and gives no higher
        velocity: a busy machine delivers held messages together.

        Args:
            goal: positions, shape (n,).
            h: the step, s.
            velocity: velocity at the goal, shape (n,), if stated by the sender.
        """
        state, since = self.state, self.state.since
        streaming = state.activity is Activity.FOLLOW and since <= STREAM_GAP
        early = streaming and (state.waiting > _EARLY * h or since < 0.5 * h)
        state.stated = velocity is not None
        if velocity is None and streaming:
            velocity = (goal - self.goal) / max(since, h)
            if early:
                fastest_before = np.abs(self._arrival)
                velocity = clip(velocity, -fastest_before, fastest_before)
        if velocity is None:
            self._arrival[:] = 0.0
        else:
            np.minimum(np.maximum(velocity, self._backwards), self._velocity, out=self._arrival)
        self.goal[:] = goal
        if not early:
            state.waiting = max(since, h) if streaming else h
        state.since, state.pending = 0.0, False
        state.activity = Activity.FOLLOW

    def drift(self, velocity: Vector) -> None:
        """Move with `velocity`, shape (n,), as long as a new velocity arrives within `STREAM_GAP`.

        Afterwards, and at a range's end, the setpoint comes to rest.
        """
        self._arrival[:] = clip(velocity, -self._velocity, self._velocity)
        self.state.since, self.state.pending = 0.0, False
        self.state.activity = Activity.DRIFT

    def move(self, goal: Vector, ratio: Vector) -> None:
        """Start a trajectory from the present state to rest at `goal`, shape (n,), inside the ranges.

        `ratio`, shape (2,), scales the velocity, and the acceleration with the jerk. A setpoint too fast to
        stay inside the ranges brakes first.
        """
        self.goal[:] = goal
        self.state.ratio[:] = ratio
        self._origin[:] = self.position, self.velocity, self.state.acceleration
        if self._plan():
            self.state.activity, self.state.elapsed, self.state.pending = Activity.MOVE, 0.0, False
        else:
            self.state.activity, self.state.pending = Activity.BRAKE, True

    def brake(self) -> None:
        """Come to rest as quickly as following allows, and stay there."""
        self.state.activity, self.state.pending = Activity.BRAKE, False
        self.state.acceleration[:] = 0.0

    def step(self, h: float) -> bool:
        """Advance by `h` seconds; return whether a move or braking has ended in this step."""
        activity = self.state.activity
        if activity is Activity.HOLD:
            return False
        if activity is Activity.MOVE:
            return self._go_on(h)
        if activity is Activity.FOLLOW:
            Followers((self,), h).step()
            return False
        if activity is Activity.DRIFT and self.state.since <= STREAM_GAP:
            most_down, most_up = fastest(
                np.array([self.position - self._lower, self._upper - self.position]), self._most, h
            )
            steer(
                self.position,
                self.velocity,
                self._arrival,
                self.limits,
                most_down,
                most_up,
                h,
                out=self.course[:3],
            )
            self.state.since += h
            return False
        return self._slow_down(h)

    def recompute_derived(self) -> None:
        """Recompute all values derived from `state` after a restore."""
        if self.state.activity is Activity.MOVE:
            self._plan()

    def _rest(self) -> None:
        self.course[1:3] = 0.0
        self.state.activity, self.state.pending = Activity.HOLD, False

    def _plan(self) -> bool:
        """Compute the trajectory from the origin to the goal; return whether it stays inside the ranges."""
        request, (faster, harder) = InputParameter(self._n), self.state.ratio.tolist()
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
        """Compare the trajectory with the ranges, unless starting from rest.

        Ruckig's `position_extrema` leaves out the braking at the start.
        """
        if not self._origin[1:].any():
            return True
        times = np.linspace(0.0, self._trajectory.duration, _LOOKS).tolist()
        way = np.array([self._trajectory.at_time(time)[0] for time in times])
        return bool((way >= self._lower - _PASSING).all() and (way <= self._upper + _PASSING).all())

    def _go_on(self, h: float) -> bool:
        elapsed = self.state.elapsed = self.state.elapsed + h
        if elapsed >= self._trajectory.duration:
            self.position[:] = self.goal
            self._rest()
            return True
        position, self.velocity[:], self.state.acceleration[:] = self._trajectory.at_time(elapsed)
        self.position[:] = clip(np.array(position), self._lower, self._upper)
        return False

    def _slow_down(self, h: float) -> bool:
        room = h * self._most
        self.velocity -= clip(self.velocity, -room, room)
        self.position += h * self.velocity
        self.position[:] = clip(self.position, self._lower, self._upper)
        if self.velocity.any():
            return False
        if self.state.pending:
            self.state.acceleration[:] = 0.0
            self.move(self.goal.copy(), self.state.ratio.copy())
            return False
        self.goal[:] = self.position
        self._rest()
        return True
