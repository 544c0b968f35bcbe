"""Forks from a page: what may be changed, and the command that does it.

The past is simulated again by `trocar fork`, as if the command had been typed.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from hub.planning import registry
from hub.planning.plan import Plan
from hub.recording.family import family
from hub.recording.recording import Recording
from schemas.scenario import Scenario
from webconsole.changes import WORD, require_harmless
from webconsole.commands import Fork
from webconsole.started import page_devices, recorded_in

__all__ = ["fork_arguments", "fork_form", "fork_modules", "tree_of"]

_MOST_MEMBERS = 200


def fork_form(recording: Recording) -> dict[str, Any]:
    """Return what the form of a fork offers: devices with their kinds, numbers that may be changed."""
    scenario, plan = recording.scenario(), recording.plan()
    devices = [
        {"name": name, "kind": one.kind}
        for name, one in scenario.participants.items()
        if name in plan.participants and plan.participants[name].role == "device"
    ]
    return {
        "devices": devices,
        "duration": None if scenario.duration is None else scenario.duration / 1e9,
        "parameters": [*_parameters(scenario, plan)],
    }


def fork_modules(scenario: Scenario) -> list[str]:
    """Return the modules that a fork of a session of this scenario imports."""
    kinds = {one.kind for one in scenario.participants.values()} & set(registry.kinds())
    # an engine imports its libraries when it is configured; most have the name of their distribution
    packages = {package for kind in kinds for package in registry.extra_packages(kind)}
    return ["hub.fork", *sorted({registry.find(kind).entry.module for kind in kinds}), *sorted(packages)]


def _parameters(scenario: Scenario, plan: Plan) -> Iterator[str]:
    """Yield `participant.parameter=value` for the numbers, switches and words of what is stepped."""
    for name in plan.order:
        spec = scenario.participants[name]
        if spec.kind not in registry.kinds():
            continue
        for key, field in registry.load(spec.kind).params_model.model_fields.items():
            value = spec.params.get(key, field.default)
            if isinstance(value, bool | int | float):
                yield f"{name}.{key}={str(value).lower()}"
            elif isinstance(value, str) and WORD.fullmatch(value):
                yield f"{name}.{key}={value}"


def fork_arguments(recording: Recording, order: Fork) -> list[str]:
    """Return the arguments of `trocar` that fork a recording as a page asks.

    Raises MessageError if a change names a class, a file or a device that is not there, and ScenarioError if
    it is none.
    """
    scenario = recording.scenario()
    changes = [*page_devices(scenario, order.lead), *order.changes]
    if order.duration is not None:
        changes.append(f"duration={order.duration:g}")
    require_harmless(scenario, changes)
    arguments = ["fork", str(recording.file), "--at", f"{order.time:.9f} s"]
    arguments += [f"--set={change}" for change in changes]
    if order.pace is not None:
        arguments += ["--pace", order.pace]
    if order.record:
        home = recording.file.resolve().parent
        arguments += ["--record", str(recorded_in(home.parent, f"{home.name}-at-{order.time:g}s"))]
    return arguments


def tree_of(recording: Recording) -> list[dict[str, Any]]:
    """Return the recordings beside this one, each followed by its forks; ready for JSON."""
    file = recording.file.resolve()
    files = sorted(file.parent.parent.glob("*/*.mcap"))[:_MOST_MEMBERS]
    return [
        {
            "name": one.file.parent.name,
            "depth": one.depth,
            "session": one.session,
            "end": one.duration_ns / 1e9,
            "at": None if one.origin is None else one.origin.time_ns / 1e9,
            "changes": [] if one.origin is None else list(one.origin.changes),
            "shown": one.file == file,
        }
        for one in family({*files, file})
    ]
