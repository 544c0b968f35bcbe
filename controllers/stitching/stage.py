"""How far a person and the procedure are with a stitch, and what the person may say then."""

from __future__ import annotations

from enum import IntEnum

__all__ = ["COMMANDS", "Stage"]


class Stage(IntEnum):
    """The stages of one stitch; the arms are moved in RUNNING alone."""

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
    """It cannot go on as planned, and has said why; the arms hold."""


COMMANDS: dict[str, tuple[Stage, ...]] = {
    "consent": (Stage.PROPOSED,),
    "pause": (Stage.RUNNING,),
    "resume": (Stage.PAUSED, Stage.TAKEN_OVER, Stage.STOPPED),
    "take over": (Stage.RUNNING, Stage.PAUSED, Stage.STOPPED),
    "cancel": (Stage.PICKING, Stage.PROPOSED, Stage.PAUSED, Stage.TAKEN_OVER, Stage.STOPPED),
}
"""What a person may say, and in which stages."""
