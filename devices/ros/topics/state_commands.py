"""Latched `state_command`s: new commands, distinguished from repeated deliveries."""

from __future__ import annotations

from robots.dvrk.repeats import RememberedCommands

__all__ = ["RepeatedStateCommands"]


class RepeatedStateCommands(RememberedCommands):
    """Refuses state commands on their second arrival: latched messages repeat when a client reconnects."""

    def refusal(self, stamp_ns: int) -> str | None:
        """Return why a command with this stamp (ns) is refused; otherwise remember the stamp."""
        if not self.is_repeated(*divmod(stamp_ns, 1_000_000_000)):
            return None
        return f"accepted before, with the same stamp, {stamp_ns / 1e9:.9f} s: a new command has a new stamp"
