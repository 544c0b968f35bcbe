"""Sessions from a page: the form of an installed scenario, made from its models, and the command of it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, cast

import annotated_types
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from hub.planning import registry
from hub.planning.limits import shown
from hub.planning.scenario_file import installed_scenarios, load
from schemas.errors import MessageError, ScenarioError
from webconsole.changes import WORD, require_harmless
from webconsole.commands import Start
from webconsole.started import page_devices, recorded_in

__all__ = ["start_arguments", "start_form", "wrong_fields"]

_OF_SESSION = ("duration", "step", "window")
"""What the form offers of the scenario itself; pace and recording have controls of their own."""


def start_form(name: str) -> dict[str, Any]:
    """Return the groups of fields of an installed scenario, and its devices; raises as `load` does.

    A field has the path of its value as on the command line, `kind` (`number`, `whole`, `switch`, `choice` or
    `word`), its value in the scenario, and if the model has them: unit, limits, choices, a description.
    What the scene says for several participants at once is not offered.
    """
    _require_installed(name)
    file = load(name)
    scenario = file.scenario
    scene = cast("dict[str, Any]", file.source.tree.get("scene") or {})
    session = [field for field in _fields(scenario, "") if field["path"] in _OF_SESSION]
    groups = [{"name": "session", "kind": "", "fields": session}]
    for participant, params in file.params.items():
        fields = [field for field in _fields(params, f"{participant}.") if field["label"] not in scene]
        groups.append(
            {"name": participant, "kind": scenario.participants[participant].kind, "fields": fields}
        )
    return {
        "about": scenario.description,
        "groups": [group for group in groups if group["fields"]],
        "devices": [
            {"name": one, "kind": spec.kind}
            for one, spec in scenario.participants.items()
            if registry.find(spec.kind).role == "device"
        ],
    }


def start_arguments(order: Start, directory: Path) -> list[str]:
    """Return the arguments of `trocar` that start a scenario as a page asks; it is recorded in `directory`.

    Raises MessageError if the scenario is not installed or a change names a class or a file, ScenarioError
    with one line for each value that the models reject.
    """
    _require_installed(order.scenario)
    scenario = load(order.scenario).scenario
    changes = [*page_devices(scenario, order.lead), *order.changes]
    require_harmless(scenario, changes)
    load(order.scenario, changes)
    arguments = ["run", order.scenario, *(f"--set={change}" for change in changes)]
    if order.pace is not None:
        arguments += ["--pace", order.pace]
    if order.record:
        arguments += ["--record", str(recorded_in(directory, order.scenario))]
    return arguments


def wrong_fields(error: ScenarioError, changes: Sequence[str]) -> dict[str, str]:
    """Return the messages of an error by the path of the field that each is about."""
    found: dict[str, str] = {}
    for change in changes:
        before = f"--set {shown(change)}: "
        lines = [line.removeprefix(before) for line in str(error).splitlines() if line.startswith(before)]
        if lines:
            found[change.partition("=")[0]] = "; ".join(line.partition(": ")[2] or line for line in lines)
    return found


def _require_installed(name: str) -> None:
    if name not in installed_scenarios():
        raise MessageError(f"there is no installed scenario '{shown(name)}': a page starts no other")


def _fields(model: BaseModel, prefix: str) -> Iterator[dict[str, Any]]:
    """Yield the numbers, switches, choices and words of a model."""
    described = type(model).model_json_schema()["properties"]
    for name, info in type(model).model_fields.items():
        value, schema = getattr(model, name), described[info.alias or name]
        kind = _kind(schema, value)
        if kind is None:
            continue
        unit = _of(schema, "unit")
        scale = 1e-9 if unit == "s" and isinstance(value, int) else 1  # durations are whole nanoseconds
        yield {
            "path": f"{prefix}{name}",
            "label": name,
            "about": info.description or "",
            "kind": kind,
            "unit": unit or "",
            "value": value * scale if kind == "number" and value is not None else value,
            "choices": _of(schema, "enum") or [],
            **{limit: bound * scale for limit, bound in _limits(info)},
        }


def _kind(schema: dict[str, Any], value: Any) -> str | None:
    """Return which control a value has; None if none has it: a list, a mapping, a path."""
    if "const" in schema:
        return None
    if _of(schema, "enum"):
        return "choice"
    if isinstance(value, bool):
        return "switch"
    types = {one.get("type") for one in (schema, *schema.get("anyOf", ()))}
    if _of(schema, "unit") or "number" in types:
        return "number" if isinstance(value, int | float | None) else None
    if "integer" in types and isinstance(value, int | None):
        return "whole"
    return "word" if isinstance(value, str) and WORD.fullmatch(value) else None


def _of(schema: dict[str, Any], key: str) -> Any:
    """Return what a schema, or one of its alternatives, says under a key; None if none does."""
    return next((one[key] for one in (schema, *schema.get("anyOf", ())) if key in one), None)


def _limits(info: FieldInfo) -> Iterator[tuple[str, Any]]:
    """Yield `least` and `most` of a field; a limit that is itself not allowed is the model's to reject."""
    for one in info.metadata:
        match one:
            case annotated_types.Ge(bound) | annotated_types.Gt(bound):
                yield "least", bound
            case annotated_types.Le(bound) | annotated_types.Lt(bound):
                yield "most", bound
            case _:
                pass
