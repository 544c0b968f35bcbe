"""The stages of a guided stitch, and the words of a person allowed in each."""

from __future__ import annotations

from enum import IntEnum

__all__ = ["COMMANDS", "Stage"]


class Stage(IntEnum):
    """The stages of a stitch; the arms are moved in RUNNING alone."""

    PICKING = 0
    """Points are awaited: first the entry, then the exit."""
    PROPOSED = 1
    """The path is shown, and consent is awaited."""
    RUNNING = 2
    PAUSED = 3
    """The arms hold."""
    TAKEN_OVER = 4
    """A person has the arms; nothing is commanded until `resume`."""
    STOPPED = 5
    """The planned stitch cannot go on; the reason was published; the arms hold."""


COMMANDS: dict[str, tuple[Stage, ...]] = {
    "consent": (Stage.PROPOSED,),
    "pause": (Stage.RUNNING,),
    "resume": (Stage.PAUSED, Stage.TAKEN_OVER, Stage.STOPPED),
    "take over": (Stage.RUNNING, Stage.PAUSED, Stage.STOPPED),
    "cancel": (Stage.PICKING, Stage.PROPOSED, Stage.PAUSED, Stage.TAKEN_OVER, Stage.STOPPED),
}
"""Words of a person, with the stages that allow each word."""
