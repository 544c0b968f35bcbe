"""The state of a setpoint: what a save of its arm holds."""

from __future__ import annotations

from enum import IntEnum

from hub.participant import Record, array, choice, flag, number

__all__ = ["Activity", "SetpointState"]


class Activity(IntEnum):
    """Activity of a setpoint."""

    HOLD = 0
    FOLLOW = 1
    MOVE = 2
    BRAKE = 3
    DRIFT = 4


class SetpointState(Record):
    """State of the setpoint of n joints."""

    position = array("n")
    velocity = array("n")
    acceleration = array("n")
    goal = array("n")
    arrival = array("n")
    """Velocity at the goal of a stream, or velocity of a drift."""
    origin = array(3, "n")
    """Position, velocity and acceleration where the trajectory starts."""
    activity = choice(Activity.HOLD)
    elapsed = number()
    """s since the start of the trajectory."""
    since = number()
    """s since the last command of a stream."""
    waiting = number()
    """s until the next command of a stream is due."""
    pending = flag()
    """Whether a move starts once the setpoint is at rest."""
    stated = flag()
    """Whether the sender states the velocity at the goal."""
    ratio = array(2)
    """Fractions of velocity, and of acceleration and jerk, for the trajectory."""
