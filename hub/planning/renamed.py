"""Old names and defaults, from version 0.1.0: names may be used in scenarios of this release.

Recordings are read with both at any time.
"""

from __future__ import annotations

import logging
from contextlib import suppress
from typing import Any, cast, get_args

from hub.planning import registry
from hub.planning.scenario_source import Location, Source, merge_missing
from schemas.errors import ScenarioError

__all__ = ["SCENARIOS", "current_names", "current_plan", "replace_old_names"]

log = logging.getLogger(__name__)

SCENARIOS = {"ros-paper": "ros-vrep"}
_KINDS = {"console": "dvrk-console", "paper": "vrep"}
_PARTICIPANT_KEYS = {"link": "network_link"}
_PARAMETER_VALUES = {"profile": {"paper": "vrep"}}
"""Old and new value by parameter, for every kind with only the new value."""
_EARLIER_DEFAULTS = {"0.1.0": {"bullet": {"sub_grid": False, "standstill": False}}}
"""Values for parameters of later versions, by version and kind, so that an old recording verifies."""
_EVENT_PORTS = {"mirror": ("distance", "lag")}
"""Last parts of the names of former signal ports, now event ports, by kind."""


def replace_old_names(source: Source) -> None:
    """Replace the old names in a scenario, and log a warning for each place of an old name."""
    participants = source.tree.get("participants")
    warned: set[str] = set()
    for name, spec in cast("dict[str, Any]", participants if isinstance(participants, dict) else {}).items():
        if isinstance(spec, dict):
            _replace_in(source, name, cast("dict[str, Any]", spec), warned)


def _replace_in(source: Source, name: str, spec: dict[str, Any], warned: set[str]) -> None:
    path = ("participants", name)
    for old, new in _PARTICIPANT_KEYS.items():
        # An override may use the old name for a value that the file states under the new one.
        if old in spec and (new not in spec or (*path, old) in source.overrides):
            _warn(source, (*path, old), f"'{old}' is now '{new}'", warned, key=True)
            value = spec.pop(old)
            spec[new] = merge_missing(spec[new], value) if new in spec else value
            source.stands_also_at((*path, old), (*path, new))
    kind = spec.get("kind")
    if isinstance(kind, str) and kind in _KINDS:
        _warn(source, (*path, "kind"), f"kind '{kind}' is now '{_KINDS[kind]}'", warned)
        spec["kind"] = _KINDS[kind]
    for parameter, value in _new_values(spec).items():
        _warn(source, (*path, parameter), f"'{spec[parameter]}' is now '{value}'", warned)
        spec[parameter] = value


def _new_values(spec: dict[str, Any]) -> dict[str, str]:
    """Return the new value of every parameter of a participant with an old value."""
    found: dict[str, str] = {}
    for parameter, values in _PARAMETER_VALUES.items():
        old = spec.get(parameter)
        # a kind of 0.1.0 is an installed one: to read a recording must not import what it names
        if isinstance(old, str) and old in values and str(spec.get("kind")) in registry.kinds():
            with suppress(ScenarioError):  # the validation of parameters reports an unknown kind
                field = registry.load(spec["kind"]).params_model.model_fields.get(parameter)
                accepted = get_args(field.annotation) if field else ()
                if values[old] in accepted and old not in accepted:
                    found[parameter] = values[old]
    return found


def _warn(source: Source, path: Location, renamed: str, warned: set[str], *, key: bool = False) -> None:
    place = source.place(path, key=key)
    if place not in warned:
        warned.add(place)
        log.warning(source.line(path, f"{renamed}; this release still accepts the old name", key=key))


def current_names(scenario: dict[str, Any], version: str = "") -> dict[str, Any]:
    """Return a scenario recorded by Trocar `version`, in the names of this version."""
    defaults = _EARLIER_DEFAULTS.get(version, {})
    participants = {
        name: defaults.get(spec["kind"], {}) | _current_participant(spec)
        for name, spec in scenario["participants"].items()
    }
    return scenario | {"participants": participants}


def current_plan(plan: dict[str, Any]) -> dict[str, Any]:
    """Return a recorded plan in the names of this version."""
    if "members" not in plan:
        return plan
    old = dict(plan)
    participants = {
        name: _with_event_ports(_current_participant(spec)) for name, spec in old.pop("members").items()
    }
    connections = old.pop("links")
    from_devices = [_current_connection(inlet, "source") for inlet in old.pop("inlets")]
    to_devices = [_current_connection(outlet, "target") for outlet in old.pop("outlets")]
    return old | {
        "participants": participants,
        "connections": connections,
        "from_devices": from_devices,
        "to_devices": to_devices,
    }


def _current_participant(spec: dict[str, Any]) -> dict[str, Any]:
    current = {_PARTICIPANT_KEYS.get(key, key): value for key, value in spec.items()}
    current["kind"] = _KINDS.get(spec["kind"], spec["kind"])
    return current | _new_values(current)


def _with_event_ports(planned: dict[str, Any]) -> dict[str, Any]:
    events = _EVENT_PORTS.get(planned["kind"], ())
    ports = [
        port | {"variability": "event"} if port["name"].rpartition("/")[2] in events else port
        for port in planned["ports"]
    ]
    return planned | {"ports": ports}


def _current_connection(connection: dict[str, Any], end: str) -> dict[str, Any]:
    """`end`: `source` or `target`, whichever is the device."""
    names = {"device": end, "device_port": f"{end}_port"}
    return {names.get(key, key): value for key, value in connection.items()}
