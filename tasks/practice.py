"""A trial without goals."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, cast

from hub.participant import Inputs, event_in
from schemas.ports import Port
from schemas.trocar_msgs import TissueEvent
from tasks.events import Event, EventKind
from tasks.instant import Instant
from tasks.params import TaskParams
from tasks.task import Task

__all__ = ["PracticeTask"]

_KINDS: dict[str, EventKind] = {"cut": "cut", "torn": "torn", "burnt": "burnt"}


class PracticeTask(Task):
    """No goals: skill is measured until the session ends, and changes of tissue are events."""

    name_of_kind: ClassVar[str] = "practice-task"

    def __init__(self, name: str, params: TaskParams) -> None:
        super().__init__(name, params)
        self._changes: tuple[TissueEvent, ...] = ()

    @property
    def goal_count(self) -> int:
        """None."""
        return 0

    @property
    def ports(self) -> tuple[Port, ...]:
        """Inputs of every task, and changes of tissue."""
        return (*super().ports, event_in("tissue/events", TissueEvent, "of an organ of kind fem"))

    def observe(self, inputs: Inputs, now: Instant) -> None:  # noqa: ARG002
        """Read the changes of tissue."""
        self._changes = cast("tuple[TissueEvent, ...]", inputs.events("tissue/events"))

    def more_events(self, now: Instant) -> Iterator[Event]:  # noqa: ARG002
        """Yield the changes of tissue; a probe with the name of an arm is the arm."""
        arms = self._watched.arms
        for change in self._changes:
            if kind := _KINDS.get(change.kind):
                arm = arms.index(change.instrument) if change.instrument in arms else -1
                yield Event(kind, arm=arm, value=change.size, unit=change.unit)
