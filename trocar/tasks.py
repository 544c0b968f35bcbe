"""Training tasks of your own: a class that says what its goals are gets events, metrics and scores.

`Task` is the base of all, `TaskParams` that of their parameters; `Goals` are the places where objects belong,
and an `Event` is what happens to them. `docs/tutorials/own-task.md` makes one.
"""

from tasks.events import Event
from tasks.goals import Goals
from tasks.params import TaskParams
from tasks.task import Task

__all__ = ["Event", "Goals", "Task", "TaskParams"]
