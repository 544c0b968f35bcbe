"""The task of a recorded session, and the recorded inputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np

from hub.planning import registry
from hub.planning.plan import Plan
from hub.planning.session_parameters import SessionParameters
from hub.recording.recording import Recording
from hub.recording.trust import recorded_files, trusted_parameters
from schemas.errors import RecordingError
from schemas.vectors import has_vector
from tasks.recorded.streams import Scored, Stream, score
from tasks.task import Task

__all__ = ["score_session"]

_PERIOD_NS = 10_000_000
"""Period of a task missing in the session."""


def score_session(recording: Recording, rules: Sequence[str], *, trust: bool = False) -> dict[str, Scored]:
    """Return the score of each task of a recorded session by name, by `rules` or by the task's own rules.

    A session without a task is measured without goals, with a peg board in the scene by the board's goals.
    `trust` allows tasks of foreign classes. Raises RecordingError for a recording without a session or an
    arm, ScenarioError for unknown rules.
    """
    plan, scenario = recording.plan(), recording.scenario()
    found: dict[str, Scored] = {}
    for name, spec in scenario.participants.items():
        if _is_task(spec.kind, trust=trust):
            task = _make(trusted_parameters(recording, [name], trust=trust), name, rules)
            _require(recording, plan, task)
            found[name] = score(
                task, _inputs(recording, plan, name), plan.participants[name].period * plan.step_ns
            )
    return found or {"practice": _without_task(recording, rules, trust=trust)}


def _require(recording: Recording, plan: Plan, task: Task) -> None:
    """Raise RecordingError if a required input of the task was not recorded."""
    needed = {
        port.name
        for port in task.ports
        if port.causality == "input" and port.variability != "event" and port.start is None
    }
    sources = [
        f"{one.source}.{one.source_port}"
        for one in plan.connections
        if one.target == task.name and one.target_port in needed
    ]
    if missing := [source for source in sources if source not in recording]:
        raise RecordingError(
            f"'{recording.file}' cannot be scored: it lacks {', '.join(missing)}, which '{task.name}' reads;"
            " `trocar run --record` records every topic: take all of them when a recording is filtered"
        )


def _inputs(recording: Recording, plan: Plan, task: str) -> dict[str, Stream]:
    """Return the recorded inputs of a task of the session, by input."""
    found: dict[str, Stream] = {}
    for one in plan.connections:
        source = f"{one.source}.{one.source_port}"
        if one.target == task and source in recording:
            steps = plan.participants[one.source].period if one.fresh else 0
            found[one.target_port] = _stream(recording, source, steps * plan.step_ns)
    for one in plan.from_devices:
        source = f"{one.source}.{one.source_port}"
        if one.target == task and source in recording:
            found[one.target_port] = _stream(recording, source, 0)
    return found


def _is_task(kind: str, *, trust: bool) -> bool:
    if ":" in kind and not trust:
        return False
    loaded = registry.load(kind) if ":" in kind or kind in registry.kinds() else None
    return loaded is not None and issubclass(loaded, Task)


def _make(parameters: SessionParameters, name: str, rules: Sequence[str]) -> Task:
    asked = {"rules": list(rules)} if rules else {}
    last = {name: {**parameters.last[name], **asked}}
    made, _ = replace(parameters, last=last, renewals=()).make(name)
    if not isinstance(made, Task):
        raise RecordingError(f"'{parameters.kinds[name]}' is no task")
    return made


def _without_task(recording: Recording, rules: Sequence[str], *, trust: bool) -> Scored:
    """Return the score by a task missing in the session, from the scene of the robot."""
    robot, scene = _robot_participant(recording)
    arms = {
        arm: one for arm, one in _table(scene, "arms").items() if f"{robot}.{arm}/measured_cp" in recording
    }
    objects = {
        thing: one for thing, one in _table(scene, "objects").items() if f"{robot}.{thing}/pose" in recording
    }
    fixtures = _table(scene, "fixtures")
    boards = [name for name in fixtures if _table(fixtures, name).get("kind") == "board"]
    kind = "peg-board-task" if boards else "practice-task"
    params = {key: scene[key] for key in ("mounting", "setup_joints") if key in scene}
    params |= {"arms": arms, "objects": objects} | ({"fixtures": fixtures} if fixtures else {})
    files = recorded_files(recording, trust=trust)
    task = _make(SessionParameters({"practice": kind}, {"practice": params}, (), files), "practice", rules)
    streams = {
        port.name: _stream(recording, f"{robot}.{port.name}", _PERIOD_NS)
        for port in task.ports
        if port.causality == "input" and f"{robot}.{port.name}" in recording
    }
    return score(task, streams | _hands(recording, task), _PERIOD_NS)


def _robot_participant(recording: Recording) -> tuple[str, dict[str, Any]]:
    """Return the participant publishing the poses of arms, best an engine, and the parameters."""
    plan, specs = recording.plan(), recording.scenario().participants
    engines = {name for name, planned in plan.participants.items() if planned.role == "engine"}
    for name, spec in sorted(specs.items(), key=lambda item: item[0] not in engines):
        if any(f"{name}.{arm}/measured_cp" in recording for arm in _table(spec.params, "arms")):
            return name, spec.params
    raise RecordingError(
        f"'{recording.file}' cannot be scored: it has no `measured_cp` of an arm, such as"
        " robot.PSM1/measured_cp of a MuJoCo robot; record a session that has one"
    )


def _table(params: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return a mapping of a recorded scenario, perhaps a stranger's; empty: not a mapping."""
    value: Any = params.get(name)
    return cast("dict[str, Any]", value) if isinstance(value, dict) else {}


def _hands(recording: Recording, task: Task) -> dict[str, Stream]:
    """Return by input whether a teleoperation led the arm."""
    found: dict[str, Stream] = {}
    for name, spec in recording.scenario().participants.items():
        arm = spec.params.get("arm")
        if arm in task.params.psms and f"{name}.following" in recording:
            found[f"{arm}/following"] = _stream(recording, f"{name}.following", _PERIOD_NS)
    return found


def _stream(recording: Recording, port: str, ahead_ns: int) -> Stream:
    series = recording[port]
    times_ns = np.round(series.time * 1e9).astype(np.int64)
    if has_vector(series.type):
        return Stream(times_ns, series.values, ahead_ns)
    return Stream(times_ns, [message for _, message in series.messages()], ahead_ns)
