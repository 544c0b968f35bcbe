"""Forks from a page: the changeable values, and the command of the fork.

The past is simulated again by `trocar fork`, as if the command had been typed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any

from hub.planning import registry
from hub.planning.plan import Plan
from hub.recording.family import recording_family
from hub.recording.recording import Recording
from schemas.errors import ScenarioError
from schemas.quantity import to_si
from schemas.scenario import Scenario
from webconsole.changes import overrides
from webconsole.commands import Fork
from webconsole.fields import Field, participant_fields
from webconsole.started import new_recording_path, page_devices

__all__ = ["fork_arguments", "fork_form", "fork_modules", "tree_of"]

_MOST_MEMBERS = 200


def fork_form(recording: Recording) -> dict[str, Any]:
    """Return the form of a fork: devices with their kinds, and the changeable values."""
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
    """Return the modules imported by a fork of a session of this scenario."""
    kinds = {one.kind for one in scenario.participants.values()} & set(registry.kinds())
    # an engine imports its libraries when it is configured; most have the name of their distribution
    packages = {package for kind in kinds for package in registry.extra_packages(kind)}
    return ["hub.fork", *sorted({registry.find(kind).entry.module for kind in kinds}), *sorted(packages)]


def _parameters(scenario: Scenario, plan: Plan) -> Iterator[str]:
    """Yield `participant.parameter=value` for the numbers, switches and choices of stepped participants."""
    for name in plan.order:
        spec = scenario.participants[name]
        for field in participant_fields(name, spec.kind):
            with suppress(ValueError, ScenarioError):  # a stranger's recording may hold anything
                if (value := _value(field, spec.params)) is not None:
                    yield field.override(value)


def _value(field: Field, params: Mapping[str, Any]) -> Any:
    """Return a recorded parameter in the field's unit; raises ValueError for another quantity."""
    if field.label not in params:
        return field.in_unit(field.default)
    value = params[field.label]
    return to_si(value, field.unit) if field.unit and isinstance(value, str) else value


def fork_arguments(recording: Recording, order: Fork) -> list[str]:
    """Return the arguments of `trocar` to fork a recording on a page's order.

    Raises MessageError if a page may not change a value or a device is not there, ScenarioError if a value
    is not of the field's type.
    """
    scenario = recording.scenario()
    changes = [*page_devices(scenario, order.lead), *overrides(scenario, order.changes)]
    if order.duration is not None:
        changes.append(f"duration={order.duration:g}")
    arguments = ["fork", str(recording.file), "--at", f"{order.time:.9f} s"]
    arguments += [f"--set={change}" for change in changes]
    if order.pace is not None:
        arguments += ["--pace", order.pace]
    if order.record:
        home = recording.file.resolve().parent
        arguments += ["--record", str(new_recording_path(home.parent, f"{home.name}-at-{order.time:g}s"))]
    return arguments


def tree_of(recording: Recording) -> list[dict[str, Any]]:
    """Return this recording's neighbours, each followed by its forks; ready for JSON."""
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
        for one in recording_family({*files, file})
    ]
