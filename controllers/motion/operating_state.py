"""CRTK's operating states, and which command each of them takes.

As on the dVRK (jhu-cisst/cisst, prmOperatingState): what is not listed is refused with a warning. Two
accidents of that code are not followed: there `pause` is let through in DISABLED, and so is `home`, which
then powers the arm first; the second is kept, as clients use it.
"""

from __future__ import annotations

from enum import IntEnum
from zlib import crc32

import numpy as np

from robots.dvrk.crtk import REMEMBERED_COMMANDS
from schemas.crtk import StringStamped
from schemas.errors import did_you_mean

__all__ = ["Desired", "Repeats", "State", "refusal"]


class State(IntEnum):
    """What an arm may do: nothing (DISABLED, FAULT: the drives are off), everything, or stay (PAUSED)."""

    DISABLED = 0
    ENABLED = 1
    PAUSED = 2
    FAULT = 3


class Desired(IntEnum):
    """Where an arm is told to go; what `desired_state` says unless the arm is paused or in fault."""

    DISABLED = 0
    ENABLED = 1
    HOMED = 2


_COMMANDS = {
    State.DISABLED: ("enable", "disable", "home", "unhome"),
    State.ENABLED: ("enable", "disable", "home", "unhome", "pause"),
    State.PAUSED: ("disable", "unhome", "pause", "resume"),
    State.FAULT: ("disable", "unhome"),
}


def refusal(state: State, command: str) -> str | None:
    """Return why `state` does not take `command`; None if it does."""
    known = {name for commands in _COMMANDS.values() for name in commands}
    if command not in known:
        return f"state_command '{command}' is unknown.{did_you_mean(command, known)}"
    if command not in _COMMANDS[state]:
        return (
            f"state_command '{command}' is refused in state {state.name}, which takes"
            f" {', '.join(_COMMANDS[state])}"
        )
    return None


class Repeats:
    """Finds state commands that come a second time: latched, they do so whenever a client's connection is
    made anew.
    """

    def __init__(self) -> None:
        """Remember none."""
        self.state = np.zeros((REMEMBERED_COMMANDS, 3))
        """Stamps (s, ns) and checksums of the commands heeded last, the newest first."""

    def refusal(self, message: StringStamped) -> str | None:
        """Return why a command that was heeded before is not heeded again, else None, and remember it; one
        without a stamp is always new.
        """
        stamp = message.header.stamp
        if not (stamp.sec or stamp.nanosec):
            return None
        mark = np.array([stamp.sec, stamp.nanosec, crc32(message.string.encode())], np.float64)
        if (self.state == mark).all(axis=1).any():
            return (
                f"state_command '{message.string}' of time {stamp.sec}.{stamp.nanosec:09d} s is refused: it"
                " was heeded before; a new one has a new stamp"
            )
        self.state[1:] = self.state[:-1].copy()
        self.state[0] = mark
        return None
