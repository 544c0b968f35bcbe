"""Sub-tasks of clip-and-cut, steps of a sub-task, and reasons to give up.

The 17 sub-tasks and their order are those of the data set ImitateCholec (doi:10.1038/s41597-025-06526-z), on
which the policy SRT-H was trained.
"""

from __future__ import annotations

from enum import IntEnum

__all__ = ["CLIPS", "CUT", "FAILURES", "Failure", "Step", "SubTask", "instruction", "sub_task_of"]

CLIPS = 3
"""Clips on each tube: two on the patient's side of the cut, one on the gallbladder's side."""
CUT = CLIPS
"""Number of the cut among the jobs on a tube, after the clips 0 to 2."""


class SubTask(IntEnum):
    """Sub-tasks; left and right are the first and the second tube."""

    START = 0
    GRASP_GALLBLADDER = 1
    CLIP_1_LEFT = 2
    BACK_FROM_CLIP_1_LEFT = 3
    CLIP_2_LEFT = 4
    BACK_FROM_CLIP_2_LEFT = 5
    CLIP_3_LEFT = 6
    BACK_FROM_CLIP_3_LEFT = 7
    CUT_LEFT = 8
    BACK_FROM_CUT_LEFT = 9
    CLIP_1_RIGHT = 10
    BACK_FROM_CLIP_1_RIGHT = 11
    CLIP_2_RIGHT = 12
    BACK_FROM_CLIP_2_RIGHT = 13
    CLIP_3_RIGHT = 14
    BACK_FROM_CLIP_3_RIGHT = 15
    CUT_RIGHT = 16
    BACK_FROM_CUT_RIGHT = 17
    DONE = 18
    FAILED = 19


def sub_task_of(tube: int, job: int) -> SubTask:
    """Return the sub-task of a job on a tube; the next number is the way back from there."""
    return SubTask(SubTask.CLIP_1_LEFT + 2 * (CLIPS + 1) * tube + 2 * job)


def instruction(task: SubTask, tube: str) -> str:
    """Return a sub-task as a request to a policy; `tube` is the organ. Empty before and after the work."""
    if task is SubTask.GRASP_GALLBLADDER:
        return "grasp the gallbladder"
    if not SubTask.CLIP_1_LEFT <= task <= SubTask.BACK_FROM_CUT_RIGHT:
        return ""
    job, is_way_back = divmod((task - SubTask.CLIP_1_LEFT) % (2 * (CLIPS + 1)), 2)
    organ = tube.replace("_", " ")
    if job == CUT:
        return f"go back from the cut in the {organ}" if is_way_back else f"cut the {organ}"
    clip = f"the {('first', 'second', 'third')[job]} clip"
    return f"go back from {clip} on the {organ}" if is_way_back else f"put {clip} on the {organ}"


class Step(IntEnum):
    """Steps of a sub-task."""

    PLAN = 0
    HOVER = 1
    """On the way to a place before the tube, jaws open."""
    REACH = 2
    """Straight ahead, the tube between the jaws."""
    CLOSE = 3
    CHECK = 4
    """Waiting for a sign of success."""
    OPEN = 5
    LEAVE = 6
    """Straight back."""
    REST = 7
    """On the way to the resting place."""
    RELOAD = 8
    """At the resting place: the next clip is put into the applier."""
    RETRACT = 9
    """Pulling at the gallbladder."""


class Failure(IntEnum):
    """Reason to give up."""

    NONE = 0
    GRASP_MISSED = 1
    GRASP_SLIPPED = 2
    CLIP_SLIPPED = 3
    CLIP_LOST = 4
    NOT_PARTED = 5
    OUT_OF_REACH = 6
    TOO_SHORT = 7
    BLOCKED = 8
    REFUSED = 9
    OPEN = 10


FAILURES = {
    Failure.GRASP_MISSED: "grasp missed",
    Failure.GRASP_SLIPPED: "grasp slipped",
    Failure.CLIP_SLIPPED: "clip slipped",
    Failure.CLIP_LOST: "clip pulled off",
    Failure.NOT_PARTED: "not parted",
    Failure.OUT_OF_REACH: "out of reach",
    Failure.TOO_SHORT: "tube too short",
    Failure.BLOCKED: "blocked",
    Failure.REFUSED: "command refused",
    Failure.OPEN: "stump not closed",
}
"""Words for each failure."""
