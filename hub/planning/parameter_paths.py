"""The paths among the parameters of a participant, found before validation: validation may read files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, cast

from hub.participant import Params
from hub.planning.json_schema import json_schema

__all__ = ["parameter_paths"]

_Schema = Mapping[str, Any]

_FORMATS = ("path", "file-path", "directory-path")
"""Formats of `Path`, `FilePath` and `DirectoryPath` of pydantic in a JSON schema."""


def parameter_paths(model: type[Params], values: Mapping[str, Any]) -> set[str]:
    """Return every text in `values` at the place of a path in the model, as written."""
    schema = json_schema(model)
    return set(_paths_in(schema, values, schema.get("$defs", {})))


def _paths_in(schema: _Schema, value: Any, definitions: _Schema) -> Iterator[str]:
    """Yield the paths in `value`; of schemas with alternatives, the paths of each."""
    if isinstance(value, str) and schema.get("format") in _FORMATS:
        yield value
    if "$ref" in schema:
        yield from _paths_in(definitions[schema["$ref"].removeprefix("#/$defs/")], value, definitions)
    for alternatives in ("anyOf", "oneOf", "allOf"):
        for alternative in schema.get(alternatives, ()):
            yield from _paths_in(alternative, value, definitions)
    for of_part, part in _parts(schema, value):
        yield from _paths_in(of_part, part, definitions)


def _parts(schema: _Schema, value: Any) -> Iterator[tuple[_Schema, Any]]:
    """Yield the entries of a mapping or a list, each with its schema, if any."""
    if isinstance(value, dict):
        known = schema.get("properties", {})
        others = (schema.get("additionalProperties"), *schema.get("patternProperties", {}).values())
        for key, part in cast("dict[str, Any]", value).items():
            for of_part in (known[key],) if key in known else others:
                if isinstance(of_part, dict):
                    yield cast("_Schema", of_part), part
    elif isinstance(value, list):
        first = schema.get("prefixItems", ())
        for index, part in enumerate(cast("list[Any]", value)):
            of_part = first[index] if index < len(first) else schema.get("items")
            if isinstance(of_part, dict):
                yield cast("_Schema", of_part), part
