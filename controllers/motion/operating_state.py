"""CRTK's operating states, and which commands each of them accepts.

As on the dVRK (jhu-cisst/cisst, prmOperatingState): what is not listed is refused with a warning. Of two
accidents of that code one is not followed: there DISABLED accepts `pause`. The other is kept, as clients use
it: DISABLED accepts `home`, which then powers the arm first.
"""

from __future__ import annotations

from enum import IntEnum

from robots.dvrk.repeats import RememberedCommands
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
    """The state that was commanded; `desired_state` publishes it unless the arm is paused or in fault."""

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
    """Return why `state` refuses `command`; None if it accepts it."""
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
    """Refuses state commands that were executed before."""

    def refusal(self, message: StringStamped) -> str | None:
        """Return why a command is refused that was executed before; otherwise remember it and return None."""
        stamp = message.header.stamp
        if not self.is_repeated(stamp.sec, stamp.nanosec, message.string):
            return None
        return (
            f"state_command '{message.string}' of time {stamp.sec}.{stamp.nanosec:09d} s is refused: it"
            " was executed before; a new one has a new stamp"
        )
