"""Following of a stream of goals: without jumps in velocity, and with stops inside the ranges.

All following setpoints of a step are computed together, at the number of numpy calls of a single arm.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from controllers.motion.setpoint_state import SetpointState
from schemas.vectors import Vector

__all__ = ["Followers", "clip", "fastest", "steer"]


def clip(value: Vector, lower: Vector, upper: Vector) -> Vector:
    """Return `value` between `lower` and `upper`."""
    return np.minimum(np.maximum(value, lower), upper)  # a third of the cost of np.clip


class Follower(Protocol):
    """A setpoint of n joints, as `Followers` use it."""

    limits: Vector
    """Position to either side, velocity and acceleration, shape (4, n)."""
    course: Vector
    """Position, velocity, acceleration, goal and velocity at the goal, shape (5, n)."""
    state: SetpointState


class Followers:
    """Setpoints following together, of N joints in all, with their constants."""

    def __init__(self, setpoints: Sequence[Follower], h: float) -> None:
        """`h`: the step, s."""
        self.setpoints, self._h = list(setpoints), h
        self._courses = [setpoint.course for setpoint in setpoints]
        sizes = [course.shape[1] for course in self._courses]
        self._owner = np.repeat(np.arange(len(sizes)), sizes)  # (N,)
        self._limits = np.concatenate([setpoint.limits for setpoint in setpoints], axis=1)  # (4, N)
        self._room = h * self._limits[3]
        self._moved = np.zeros((3, sum(sizes)))  # position, velocity, acceleration
        ends = np.cumsum(sizes).tolist()
        self._shares = [self._moved[:, end - size : end] for end, size in zip(ends, sizes, strict=True)]

    def step(self) -> None:
        """Take a step towards the goals; of a stream each goal is reached when the next is due."""
        h, room = self._h, self._room
        position, velocity, _, goal, arrival = np.concatenate(self._courses, axis=1)  # (N,) each
        lower, upper, _, most = self._limits
        states = [setpoint.state for setpoint in self.setpoints]
        waits = [max(state.waiting, h) for state in states]
        stated = [state.stated for state in states]
        wait = np.array(waits).take(self._owner)
        left = goal - position
        away = left - wait * arrival  # from where a setpoint that is in time would be now
        most_away, most_to_goal, most_down, most_up = fastest(
            np.array([np.abs(away), np.abs(left), position - lower, upper - position]), most, h
        )
        faster, bends = away / wait, np.array(stated).take(self._owner) if any(stated) else None
        if bends is not None:
            faster = np.where(bends, _bend_velocity(left, velocity, arrival, wait, h), faster)
        target = arrival + clip(faster, -most_away, most_away)
        if not all(stated):
            # while it catches up: the next goal may be late or turn back, so it must be able to come to rest
            # as near to this one as from the velocity of arrival there, and what a step adds to that
            allowed = np.hypot(most_to_goal, np.abs(arrival) + room)
            slowed = clip(target, -allowed, allowed)
            target = slowed if bends is None else np.where(bends, target, slowed)
        steer(position, velocity, target, self._limits, most_down, most_up, h, out=self._moved)
        for state, course, share, waited in zip(states, self._courses, self._shares, waits, strict=True):
            course[:3] = share
            state.since += h
            state.waiting = waited - h
            if waited == h:
                course[4] = 0.0
                state.stated = False


def _bend_velocity(left: Vector, velocity: Vector, arrival: Vector, wait: Vector, h: float) -> Vector:
    """Return the next step's velocity less the velocity of arrival, shape (N,), on a cubic of `wait` s."""
    mean = left / wait
    now, then = velocity - mean, arrival - mean  # the cubic less the straight line
    share = h / wait
    return mean + now - share * (2.0 * now + then) + share * share * (now + then) - arrival


def steer(
    position: Vector,
    velocity: Vector,
    target: Vector,
    limits: Vector,
    most_down: Vector,
    most_up: Vector,
    h: float,
    out: Vector,
) -> None:
    """Write position, velocity and acceleration after `h` seconds to `out`, shape (3, N).

    The velocity is the nearest to `target` within `limits` (`Setpoint.limits`) and the remaining distance to
    either side.
    """
    lower, upper, fast, most = limits
    room = h * most
    target = clip(clip(target, -fast, fast), velocity - room, velocity + room)
    velocity = clip(target, -most_down, most_up)
    np.minimum(np.maximum(position + h * velocity, lower), upper, out=out[0])
    out[1], out[2] = velocity, 0.0


def fastest(distance: Vector, most: Vector, h: float) -> Vector:
    """Return the largest velocity for a stop within `distance` in steps of `h`, both (..., N).

    With the velocity falling by A h a step from n A h, m = floor(n) + 1 steps go A h^2 (m n - m (m - 1) /
    2) far; solved for n. The acceleration A is `most`, shape (N,).
    """
    room = h * most
    steps = np.maximum(distance, 0.0) / (h * room)
    whole = np.floor((np.sqrt(1.0 + 8.0 * steps) - 1.0) / 2.0)
    return room * (steps / (whole + 1.0) + whole / 2.0)
