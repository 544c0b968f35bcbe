"""Latched `state_command`s: which of them a connection has delivered again, and which are new."""

from __future__ import annotations

from robots.dvrk.repeats import RememberedCommands

__all__ = ["RepeatedStateCommands"]


class RepeatedStateCommands(RememberedCommands):
    """Refuses state commands that arrive a second time: latched, they do whenever a client connects again."""

    def refusal(self, stamp_ns: int) -> str | None:
        """Return why a command with this stamp (ns) is refused; otherwise remember it and return None."""
        if not self.is_repeated(*divmod(stamp_ns, 1_000_000_000)):
            return None
        return f"accepted before, with the same stamp, {stamp_ns / 1e9:.9f} s: a new command has a new stamp"
