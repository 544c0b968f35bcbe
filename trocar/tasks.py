"""Training tasks of your own: a class with goals gets events, metrics and scores.

`Task` is the base of all tasks, `TaskParams` the base of their parameters; `Goals` are the targets of
objects, and an `Event` happens to an object. `docs/tutorials/own-task.md` makes a task.
"""

from tasks.events import Event
from tasks.goals import Goals
from tasks.params import TaskParams
from tasks.task import Task

__all__ = ["Event", "Goals", "Task", "TaskParams"]
