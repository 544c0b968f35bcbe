"""The ports of a task: what it watches, and what it reports."""

from __future__ import annotations

from collections.abc import Iterator

from hub.participant import event_in, event_out, signal_in, signal_out
from robots.dvrk.mounted.mounted_ecm import MountedEcm
from schemas.ports import Port
from schemas.ros import BoolMessage, Float64Message, PoseStamped, WrenchStamped
from schemas.trocar_msgs import ScoreCard, TaskEvent
from tasks.params import TaskParams

__all__ = ["task_ports"]

_NO_POSE, _NO_WRENCH = (*(0.0,) * 6, 1.0), (0.0,) * 6


def task_ports(params: TaskParams) -> tuple[Port, ...]:
    """Return the ports of a task; an input with a start value may be left unconnected."""
    return (*_inputs(params), *_outputs(params))


def _inputs(params: TaskParams) -> Iterator[Port]:
    wrench = "on the instrument; the force of both together is what may be excessive"
    following = "whether a hand leads the arm: `following` of its teleoperation"
    for arm in params.watched_arms:
        mounted = params.arms[arm]
        pose, base = f"{arm}/measured_cp", f"{arm}_base"
        if isinstance(mounted, MountedEcm):
            yield signal_in(pose, PoseStamped, "of the endoscope's camera", frame=base, start=_NO_POSE)
            continue
        yield signal_in(pose, PoseStamped, "of the instrument's tip", frame=base)
        for kind in ("tip", "rigid"):
            yield signal_in(f"{arm}/{kind}_wrench", WrenchStamped, wrench, frame=base, start=_NO_WRENCH)
        yield event_in(f"{arm}/following", BoolMessage, following)
    for thing in params.objects:
        yield signal_in(f"{thing}/pose", PoseStamped, frame="world")
        yield signal_in(f"{thing}/held_by", Float64Message, "number of the PSM that holds it, 0: none")
    yield _impulse("tools", "between instruments of different arms")
    if params.fixtures:
        yield _impulse("fixtures", "between instruments and boards, posts, walls and dishes")


def _impulse(what: str, between: str) -> Port:
    meaning = f"of all contacts {between} since the start"
    return signal_in(f"{what}/impulse", Float64Message, meaning, unit="N*s", start=(0.0,))


def _outputs(params: TaskParams) -> Iterator[Port]:
    score = "metrics, and the scores by each set of rules, so far"
    yield event_out("events", TaskEvent, "as they happen")
    yield signal_out("score", ScoreCard, score, period_ns=params.card_period)
    yield signal_out("progress", Float64Message, "share of the goals that are reached")
    yield signal_out("done", Float64Message, "1 when all goals have been reached")
