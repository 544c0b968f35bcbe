"""Forks from a page: what may be changed, and the command that does it.

A page names numbers, words and devices; what would import a class or read a file is the command line's alone.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

from hub.planning import registry
from hub.planning.foreign_code import names_class
from hub.planning.parameter_paths import parameter_paths
from hub.planning.plan import Plan
from hub.planning.scenario_source import Source
from hub.recording.family import family
from hub.recording.recording import Recording
from schemas.errors import MessageError
from schemas.scenario import Scenario
from webconsole.commands import Fork

__all__ = ["fork_arguments", "fork_form", "tree_of"]

_WORD = re.compile(r"[\w .,+-]*")
"""Texts of a page: names, words, durations such as `1.5 s`."""
_PAGE_DEVICE = "{kind: browser, host: remote}"
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
            elif isinstance(value, str) and _WORD.fullmatch(value):
                yield f"{name}.{key}={value}"


def fork_arguments(recording: Recording, order: Fork) -> list[str]:
    """Return the arguments of `trocar` that fork a recording as a page asks.

    Raises MessageError if a change names a class, a file or a device that is not there, and ScenarioError if
    it is none.
    """
    scenario = recording.scenario()
    if unknown := set(order.lead) - set(scenario.participants):
        raise MessageError(f"there is no device '{min(unknown)}' in this recording")
    changes = [*(f"participants.{name}={_PAGE_DEVICE}" for name in order.lead), *order.changes]
    if order.duration is not None:
        changes.append(f"duration={order.duration:g}")
    _require_harmless(scenario, changes)
    arguments = ["fork", str(recording.file), "--at", f"{order.time:.9f} s"]
    arguments += [f"--set={change}" for change in changes]
    if order.pace is not None:
        arguments += ["--pace", order.pace]
    if order.record:
        arguments += ["--record", str(_new_directory(recording, order.time))]
    return arguments


def _require_harmless(scenario: Scenario, changes: list[str]) -> None:
    """Raise MessageError if changes name a class or a file; nothing is imported that is not installed."""
    tree: dict[str, Any] = scenario.model_dump(mode="json")
    before, source = _files(tree), Source(Path("scenario.json"), tree, {})
    for change in changes:
        source.override(change)
        value = change.partition("=")[2]
        for text in _texts(_at(source, change)):
            if not _WORD.fullmatch(text):
                raise MessageError(
                    f"--set {value[:80]}: from a page only numbers and words are taken, no classes and no"
                    f" paths; use `trocar fork`"
                )
    if more := _files(source.tree) - before:
        raise MessageError(f"'{min(more)[:80]}' is a file or a class: from a page none is taken")


def _at(source: Source, change: str) -> Any:
    """Return the value that a change has set."""
    (path,) = [path for path, text in source.overrides.items() if text == change][-1:]
    value: Any = source.tree
    for part in path:
        value = value[part]
    return value


def _files(tree: dict[str, Any]) -> set[str]:
    """Return the classes and the paths that participants name."""
    found: set[str] = set()
    participants = cast("dict[str, dict[str, Any]]", tree["participants"])
    shared = cast("dict[str, Any]", tree.get("scene") or {})
    for spec in participants.values():
        kind = str(spec.get("kind"))
        if names_class(kind):
            found.add(kind)
        elif kind in registry.kinds():
            model = registry.load(kind).params_model
            for params in (shared, spec):
                found |= parameter_paths(model, params)
                found |= {str(params[name]) for name in model.native_code if params.get(name) is not None}
    return found


def _texts(value: Any) -> Iterator[str]:
    """Yield every text in a value, the keys of mappings included."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for key, part in cast("dict[Any, Any]", value).items():
            yield str(key)
            yield from _texts(part)
    elif isinstance(value, list):
        for part in cast("list[Any]", value):
            yield from _texts(part)


def _new_directory(recording: Recording, time_s: float) -> Path:
    """Return a directory beside the recording that is not there yet."""
    home = recording.file.resolve().parent
    stem = f"{home.name}-at-{time_s:g}s"
    names = (stem, *(f"{stem}-{number}" for number in range(2, 1000)))
    return next(place for name in names if not (place := home.with_name(name)).exists())


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
