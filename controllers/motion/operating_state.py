"""CRTK's operating states, and which command each of them takes.

As on the dVRK (jhu-cisst/cisst, prmOperatingState): what is not listed is refused with a warning. Two accidents of that code are not
followed: there `pause` is let through in DISABLED, and so is `home`, which then powers the arm first; the second is kept, as clients use it.
"""

from __future__ import annotations

from enum import IntEnum

from schemas.errors import did_you_mean

__all__ = ["State", "refusal"]


class State(IntEnum):
    """What an arm may do: nothing (DISABLED, FAULT: the drives are off), everything, or stay (PAUSED)."""

    DISABLED = 0
    ENABLED = 1
    PAUSED = 2
    FAULT = 3


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
        return f"state_command '{command}' is refused in state {state.name}, which takes {', '.join(_COMMANDS[state])}"
    return None
