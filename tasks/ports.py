"""The ports of a task: what it watches, and what it reports."""

from __future__ import annotations

from collections.abc import Iterator

from robots.dvrk.mounted import MountedEcm
from schemas.ports import Port
from schemas.ros import BoolMessage, Float64Message, PoseStamped, WrenchStamped
from schemas.trocar_msgs import ScoreCard, TaskEvent
from tasks.params import TaskParams

__all__ = ["task_ports"]

_POSE, _NUMBER = PoseStamped.ros_type, Float64Message.ros_type
_NO_POSE, _NO_WRENCH = (*(0.0,) * 6, 1.0), (0.0,) * 6


def task_ports(params: TaskParams) -> tuple[Port, ...]:
    """Return the ports of a task; an input with a start value may be left unconnected."""
    return (*_inputs(params), *_outputs(params))


def _inputs(params: TaskParams) -> Iterator[Port]:
    for arm, mounted in params.arms.items():
        is_camera = isinstance(mounted, MountedEcm)
        yield Port(
            name=f"{arm}/measured_cp",
            causality="input",
            type=_POSE,
            frame=f"{arm}_base",
            start=_NO_POSE if is_camera else None,
            description="of the endoscope's camera" if is_camera else "of the instrument's tip",
        )
        if is_camera:
            continue
        for kind in ("tip", "rigid"):
            yield Port(
                name=f"{arm}/{kind}_wrench",
                causality="input",
                type=WrenchStamped.ros_type,
                frame=f"{arm}_base",
                start=_NO_WRENCH,
                description="on the instrument; the force of both together is what may be excessive",
            )
        yield Port(
            name=f"{arm}/following",
            causality="input",
            type=BoolMessage.ros_type,
            variability="event",
            description="whether a hand leads the arm: `following` of its teleoperation",
        )
    for thing in params.objects:
        yield Port(name=f"{thing}/pose", causality="input", type=_POSE, frame="world")
        yield Port(
            name=f"{thing}/held_by",
            causality="input",
            type=_NUMBER,
            description="number of the PSM that holds it, 0: none",
        )
    yield _impulse("tools", "between instruments of different arms")
    if params.fixtures:
        yield _impulse("fixtures", "between instruments and boards, posts, walls and dishes")


def _impulse(what: str, between: str) -> Port:
    return Port(
        name=f"{what}/impulse",
        causality="input",
        type=_NUMBER,
        unit="N*s",
        start=(0.0,),
        description=f"of all contacts {between} since the start",
    )


def _outputs(params: TaskParams) -> Iterator[Port]:
    yield Port(
        name="events",
        causality="output",
        type=TaskEvent.ros_type,
        variability="event",
        description="as they happen",
    )
    yield Port(
        name="score",
        causality="output",
        type=ScoreCard.ros_type,
        period_ns=params.card_period,
        description="metrics, and the scores by each set of rules, so far",
    )
    yield Port(
        name="progress", causality="output", type=_NUMBER, description="share of the goals that are reached"
    )
    yield Port(
        name="done", causality="output", type=_NUMBER, description="1 when all goals have been reached"
    )
