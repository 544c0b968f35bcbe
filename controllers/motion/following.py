"""How setpoints follow a stream of goals: without jumps in velocity, and able to stop inside their ranges.

All setpoints that follow in a step do so together, so that numpy is called as often for four arms as for one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from schemas.vectors import Vector

if TYPE_CHECKING:
    from controllers.motion.setpoint import Setpoint

__all__ = ["clip", "fastest", "follow", "steer"]


def clip(value: Vector, lower: Vector, upper: Vector) -> Vector:
    """Return `value` between `lower` and `upper`."""
    return np.minimum(np.maximum(value, lower), upper)  # a third of the cost of np.clip


def follow(setpoints: Sequence[Setpoint], h: float) -> None:
    """Take a step of `h` seconds towards the goals of `setpoints`, of N joints in all.

    Of a stream each goal is reached when the next is due.
    """
    courses = [setpoint.course for setpoint in setpoints]
    position, velocity, _, goal, arrival = np.concatenate(courses, axis=1)  # (N,) each
    limits = np.concatenate([setpoint.limits for setpoint in setpoints], axis=1)
    lower, upper, _, most = limits
    waits = [max(setpoint.state.waiting, h) for setpoint in setpoints]
    stated = [setpoint.state.stated for setpoint in setpoints]
    sizes = [course.shape[1] for course in courses]
    wait = np.repeat(waits, sizes)
    left = goal - position
    away = left - wait * arrival  # from where a setpoint that is in time would be now
    most_away, most_to_goal, most_down, most_up = fastest(
        np.array([np.abs(away), np.abs(left), position - lower, upper - position]), most, h
    )
    faster, bends = away / wait, np.repeat(stated, sizes) if any(stated) else None
    if bends is not None:
        faster = np.where(bends, _bend(left, velocity, arrival, wait, h), faster)
    target = arrival + clip(faster, -most_away, most_away)
    if not all(stated):
        # while it catches up: the next goal may be late or turn back, so it must be able to come to rest
        # as near to this one as from the velocity of arrival there, and what a step adds to that
        allowed = np.hypot(most_to_goal, np.abs(arrival) + h * most)
        slowed = clip(target, -allowed, allowed)
        target = slowed if bends is None else np.where(bends, target, slowed)
    moved = steer(position, velocity, target, limits, most_down, most_up, h)
    start = 0
    for setpoint, course, waited in zip(setpoints, courses, waits, strict=True):
        end, state = start + course.shape[1], setpoint.state
        course[:3] = moved[:, start:end]
        state.since += h
        state.waiting = max(waited - h, 0.0)
        if not state.waiting:
            course[4] = 0.0
            state.stated = False
        start = end


def _bend(left: Vector, velocity: Vector, arrival: Vector, wait: Vector, h: float) -> Vector:
    """Return the next step's velocity less that of arrival, shape (N,), on a cubic of `wait` seconds."""
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
) -> Vector:
    """Return position, velocity and acceleration, shape (3, N), after `h` seconds.

    The velocity is the allowed one that is nearest to `target`; allowed is what `limits` (`Setpoint.limits`)
    and the way left to either side permit.
    """
    lower, upper, fast, most = limits
    room = h * most
    target = clip(clip(target, -fast, fast), velocity - room, velocity + room)
    velocity = clip(target, -most_down, most_up)
    return np.array([clip(position + h * velocity, lower, upper), velocity, np.zeros_like(velocity)])


def fastest(distance: Vector, most: Vector, h: float) -> Vector:
    """Return the largest velocity from which steps of `h` come to rest within `distance`, both (..., N).

    With the velocity falling by A h a step from n A h, m = floor(n) + 1 steps go A h^2 (m n - m (m - 1) /
    2) far; solved for n. The acceleration A is `most`, shape (N,).
    """
    room = h * most
    steps = np.maximum(distance, 0.0) / (h * room)
    whole = np.floor((np.sqrt(1.0 + 8.0 * steps) - 1.0) / 2.0)
    return room * (steps / (whole + 1.0) + whole / 2.0)
