"""Errors of pydantic as messages for the author of a scenario: fault, place, allowed values."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import islice
from typing import Any, cast

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from hub.planning.json_schema import json_schema
from hub.planning.limits import MAX_PROBLEMS, safe_text
from hub.planning.scenario_source import Location, Source
from schemas.errors import did_you_mean

__all__ = ["describe_errors"]


def describe_errors(
    error: ValidationError,
    model: type[BaseModel],
    prefix: Location,
    source: Source,
    *,
    other_keys: Iterable[str] = (),
) -> Iterator[str]:
    """Yield a line for each of the first errors of `model`, at `prefix` in the scenario.

    `other_keys` are allowed at `prefix` beside the fields of the model.
    """
    for detail in islice(error.errors(include_url=False), MAX_PROBLEMS):
        about_key = detail["type"] == "extra_forbidden" or detail["loc"][-1:] == ("[key]",)
        path = (*prefix, *(part for part in detail["loc"] if part != "[key]"))
        yield source.line(path, _message(detail, model, other_keys), key=about_key)
    if error.error_count() > MAX_PROBLEMS:
        yield source.line(prefix, f"has {error.error_count() - MAX_PROBLEMS} more problems")


def _message(detail: ErrorDetails, model: type[BaseModel], other_keys: Iterable[str]) -> str:
    given = detail["input"]
    match detail["type"]:
        case "extra_forbidden":
            *parents, name = detail["loc"]
            known = [*_known_keys(model, parents), *(() if parents else other_keys)]
            return f"there is no '{safe_text(str(name))}' here.{did_you_mean(safe_text(str(name)), known)}"
        case "literal_error":
            expected = str(detail.get("ctx", {}).get("expected", "")).replace(" or ", ", ")
            allowed = (word.strip("'") for word in expected.split(", "))
            text = safe_text(str(cast("object", given)))
            return f"'{text}' is not allowed.{did_you_mean(text, allowed)}"
        case "missing":
            return "is required but not given"
        case "model_type" | "dict_type":
            return f"expected a mapping, got {safe_text(repr(given))}"
        case _:
            message, value = detail["msg"].removeprefix("Value error, "), repr(given)
            return message if value in message or len(value) > 60 else f"{message} (got {value})"


def _known_keys(model: type[BaseModel], loc: Iterable[str | int]) -> set[str]:
    """Return the keys allowed by `model` at `loc`.

    The source is the model's JSON schema, where unions and nested models look alike.
    """
    root = json_schema(model)
    here = list(_schema_branches(root, root))
    for part in loc:
        children = [child for branch in here for child in _child_schemas(branch, part)]
        # no children: `part` names a branch of a union
        here = [branch for child in children for branch in _schema_branches(child, root)] or here
    return {key for branch in here for key in branch.get("properties", {})}


def _child_schemas(branch: dict[str, Any], part: str | int) -> Iterator[dict[str, Any]]:
    """Yield the schemas of the value at `part` of a mapping or a list."""
    properties: dict[str, Any] = branch.get("properties", {})
    patterns: dict[str, Any] = branch.get("patternProperties", {})
    candidates: list[Any] = (
        [properties[part]]
        if part in properties
        else [branch.get("additionalProperties"), *patterns.values(), branch.get("items")]
    )
    return (cast("dict[str, Any]", schema) for schema in candidates if isinstance(schema, dict))


def _schema_branches(schema: dict[str, Any], root: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield the alternatives of `schema`, with references followed."""
    if "$ref" in schema:
        yield from _schema_branches(root["$defs"][schema["$ref"].rpartition("/")[2]], root)
    elif alternatives := schema.get("anyOf") or schema.get("oneOf"):
        for alternative in alternatives:
            yield from _schema_branches(alternative, root)
    else:
        yield schema
