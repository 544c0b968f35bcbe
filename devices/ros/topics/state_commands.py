"""Latched `state_command`s: which of them a connection has delivered again, and which are new."""

from __future__ import annotations

from collections import deque

from robots.dvrk.crtk import REMEMBERED_COMMANDS

__all__ = ["RepeatedStateCommands"]


class RepeatedStateCommands:
    """Finds state commands that arrive a second time: latched, they do whenever a client connects again."""

    def __init__(self) -> None:
        self._stamps_ns: deque[int] = deque(maxlen=REMEMBERED_COMMANDS)

    def refusal(self, stamp_ns: int) -> str | None:
        """Return why a command with this stamp (ns) is refused; otherwise remember it and return None."""
        if stamp_ns in self._stamps_ns:
            return (
                f"accepted before, with the same stamp, {stamp_ns / 1e9:.9f} s: a new command has a new stamp"
            )
        self._stamps_ns.append(stamp_ns)
        return None
