"""A trial without goals."""

from __future__ import annotations

from typing import ClassVar

from tasks.task import Task

__all__ = ["PracticeTask"]


class PracticeTask(Task):
    """No goals: skill is measured until the session ends."""

    name_of_kind: ClassVar[str] = "practice-task"

    @property
    def goal_count(self) -> int:
        """None."""
        return 0
