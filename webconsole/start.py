"""Sessions from a page: the form of an installed scenario, made from models, and the start command."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

from hub.planning import registry
from hub.planning.limits import safe_text
from hub.planning.scenario_file import installed_scenarios, load
from schemas.errors import MessageError
from webconsole.changes import overrides
from webconsole.commands import Start
from webconsole.fields import Field, participant_fields, session_fields
from webconsole.started import new_recording_path, page_devices

__all__ = ["start_arguments", "start_form"]


def start_form(name: str) -> dict[str, Any]:
    """Return the groups of fields and the devices of an installed scenario; raises as `load` does.

    A field has the path of a value as on the command line, `kind` (`number`, `whole`, `switch`, `choice`),
    the value in the scenario, and unit, limits, choices and description if the model has any. Values of the
    scene, for several participants at once, are not offered.
    """
    _require_installed(name)
    file = load(name)
    scenario = file.scenario
    scene = cast("dict[str, Any]", file.source.tree.get("scene") or {})
    session = [_describe_field(field, getattr(scenario, field.label)) for field in session_fields()]
    groups = [{"name": "session", "kind": "", "fields": session}]
    for participant, params in file.params.items():
        kind = scenario.participants[participant].kind
        fields = [
            _describe_field(field, getattr(params, field.label))
            for field in participant_fields(participant, kind)
            if field.label not in scene
        ]
        groups.append({"name": participant, "kind": kind, "fields": fields})
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
    """Return the arguments of `trocar` to start a scenario on a page's order, recorded in `directory`.

    Raises MessageError if the scenario is not installed or a page may not change a value, ScenarioError with
    a line for each rejected value.
    """
    _require_installed(order.scenario)
    scenario = load(order.scenario).scenario
    changes = [*page_devices(scenario, order.lead), *overrides(scenario, order.changes)]
    load(order.scenario, changes)
    arguments = ["run", order.scenario, *(f"--set={change}" for change in changes)]
    if order.pace is not None:
        arguments += ["--pace", order.pace]
    if order.record:
        arguments += ["--record", str(new_recording_path(directory, order.scenario))]
    return arguments


def _require_installed(name: str) -> None:
    if name not in installed_scenarios():
        raise MessageError(f"there is no installed scenario '{safe_text(name)}': a page starts no other")


def _describe_field(field: Field, value: Any) -> dict[str, Any]:
    """Return a field with the value in the scenario, ready for JSON."""
    return {
        "path": field.path,
        "label": field.label,
        "about": field.about,
        "kind": field.control,
        "unit": field.unit,
        "value": field.in_unit(value),
        "choices": field.choices,
        **field.limits,
    }
