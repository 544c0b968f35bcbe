"""CRTK's operating states, and their accepted commands.

As on the dVRK (jhu-cisst/cisst, prmOperatingState): unlisted commands are refused with a warning. Of two
accidents of the dVRK's code the first is not followed: DISABLED accepts `pause` there. The second is kept,
because clients use it: DISABLED accepts `home`, and the arm is powered first.
"""

from __future__ import annotations

from enum import IntEnum

from robots.dvrk.repeats import RememberedCommands
from schemas.crtk import StringStamped
from schemas.errors import did_you_mean

__all__ = ["Desired", "Repeats", "State", "refusal"]


class State(IntEnum):
    """Permitted motion of an arm: none (DISABLED, FAULT: drives off), any, or standstill (PAUSED)."""

    DISABLED = 0
    ENABLED = 1
    PAUSED = 2
    FAULT = 3


class Desired(IntEnum):
    """The commanded state, published as `desired_state` unless the arm is paused or in fault."""

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
    """Return why `state` refuses `command`; None: accepted."""
    known = {name for commands in _COMMANDS.values() for name in commands}
    if command not in known:
        return f"state_command '{command}' is unknown.{did_you_mean(command, known)}"
    if command not in _COMMANDS[state]:
        return (
            f"state_command '{command}' is refused in state {state.name}, which accepts"
            f" {', '.join(_COMMANDS[state])}"
        )
    return None


class Repeats(RememberedCommands):
    """Refuses state commands executed before."""

    def refusal(self, message: StringStamped) -> str | None:
        """Return why a repeated command is refused; otherwise remember the command and return None."""
        stamp = message.header.stamp
        if not self.is_repeated(stamp.sec, stamp.nanosec, message.string):
            return None
        return (
            f"state_command '{message.string}' of time {stamp.sec}.{stamp.nanosec:09d} s is refused: it"
            " was executed before; a new one has a new stamp"
        )
