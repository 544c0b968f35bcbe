"""The trigger of a clip applier in the hand: a jaw that is shut closes the clip."""

from __future__ import annotations

from math import radians

from hub.participant import Record, flag, number

__all__ = ["ClipTrigger"]

_SHUT, _LOADED = radians(15.0), radians(25.0)
"""Command to the jaw below which a clip closes, and above which the next one is loaded; assumed.

The routine of clip-and-cut closes its clips at 12 degrees: who imitates the routine closes them, too.
"""
_DELAY = 0.1
"""Time for the jaw to arrive at a command, s; assumed."""


class ClipState(Record):
    """State of the applier."""

    loaded = flag()
    shut_for = number()
    """Time since the jaw was shut, s."""


class ClipTrigger:
    """One clip for each closing of the jaw; opening it wide loads the next."""

    def __init__(self) -> None:
        self.state = ClipState()

    def fires(self, angle: float, h: float) -> bool:
        """Return whether a clip closes now.

        Args:
            angle: command to the jaw, rad.
            h: time since the last call, s.
        """
        state = self.state
        if angle >= _LOADED:
            state.loaded = True
        state.shut_for = state.shut_for + h if angle <= _SHUT else 0.0
        if not state.loaded or state.shut_for < _DELAY:
            return False
        state.loaded = False
        return True
