"""The JSON schema of a scenario with the parameters of every installed kind, for yaml-language-server."""

from __future__ import annotations

import json
from typing import Any

from hub.planning import registry
from schemas.scenario import ParticipantSpec, Scenario

__all__ = ["scenario_schema"]

_PORT = r"\s*[A-Za-z][A-Za-z0-9_]*\.\S+\s*"
_TEXT_FORMS = {"PortReference": rf"^{_PORT}$", "Connection": rf"^{_PORT}->{_PORT}$"}
"""Parts of a scenario with an alternative form, a line of text."""


def scenario_schema() -> str:
    """Return the schema as JSON text, a definition in a line. Kinds that cannot be loaded are left out."""
    schema = Scenario.model_json_schema()
    definitions: dict[str, Any] = schema["$defs"]
    for name, pattern in _TEXT_FORMS.items():
        definitions[name] = {"anyOf": [{"type": "string", "pattern": pattern}, definitions[name]]}
    common = definitions["ParticipantSpec"]["properties"]
    definitions["ParticipantSpec"] = _participant_schema(common, definitions)
    parts = {"$schema": "http://json-schema.org/draft-07/schema#", **schema, "$defs": "@"}
    rows = (f'"{name}":{_compact_json(definition)}' for name, definition in definitions.items())
    return _compact_json(parts).replace('"@"', "{\n" + ",\n".join(rows) + "\n}") + "\n"


def _compact_json(value: Any) -> str:
    return json.dumps(value, separators=(",", ":"))


def _participant_schema(common: dict[str, Any], definitions: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of a participant: a branch for each kind, so that an editor reports against the kind.

    Parameters may be missing or null: the scene may set a parameter, or null may keep it out. `trocar check`
    reports parameters still missing in the end.
    """
    broken = registry.broken_kinds()
    kinds = [kind for name, kind in sorted(registry.kinds().items()) if name not in broken]
    branches: list[dict[str, Any]] = []
    for kind in kinds:
        params = registry.load(kind.name).params_model.model_json_schema(
            ref_template=f"#/$defs/{kind.name}.{{model}}"
        )
        definitions.update(
            {f"{kind.name}.{name}": definition for name, definition in params.pop("$defs", {}).items()}
        )
        properties = {key: common[key] for key in ParticipantSpec.RESERVED} | {
            name: _or_null(schema) for name, schema in params.get("properties", {}).items()
        }
        then = {"properties": properties, "additionalProperties": False}
        branches.append({"if": {"properties": {"kind": {"const": kind.name}}}, "then": then})
    kind_schema = common["kind"] | {"enum": [kind.name for kind in kinds]}
    return {
        "type": "object",
        "properties": common | {"kind": kind_schema},
        "required": ["kind"],
        "allOf": branches,
    }


def _or_null(schema: dict[str, Any]) -> dict[str, Any]:
    """Return a schema with null also allowed; unlike with `anyOf`, errors point into the value."""
    shown = {key: schema[key] for key in ("description", "default") if key in schema}
    rest = {key: value for key, value in schema.items() if key not in shown}
    return shown | {"if": {"type": "null"}, "then": True, "else": rest}
