"""Hand-over of objects between two arms."""

from __future__ import annotations

from typing import ClassVar

from tasks.events import Event
from tasks.task import Task

__all__ = ["HandOverTask"]


class HandOverTask(Task):
    """Every object is to be picked up by an arm and handed over to another arm."""

    name_of_kind: ClassVar[str] = "hand-over-task"

    def reaches(self, event: Event) -> bool:
        """Say whether an object has been handed over."""
        return event.kind == "handed over"
