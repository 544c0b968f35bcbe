"""What pydantic found wrong in a scenario, told to the person who wrote it: what, where, what was allowed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, cast

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from hub.planning.scenario_source import Location, Source
from schemas.errors import did_you_mean

__all__ = ["problems"]


def problems(
    error: ValidationError, model: type[BaseModel], prefix: Location, source: Source
) -> Iterator[str]:
    """Yield one line for each thing that `model`, which stands at `prefix` in the scenario, found wrong."""
    for detail in error.errors(include_url=False):
        about_key = detail["type"] == "extra_forbidden" or detail["loc"][-1:] == ("[key]",)
        path = (*prefix, *(part for part in detail["loc"] if part != "[key]"))
        yield source.line(path, _message(detail, model), key=about_key)


def _message(detail: ErrorDetails, model: type[BaseModel]) -> str:
    match detail["type"]:
        case "extra_forbidden":
            name = str(detail["loc"][-1])
            return f"there is no '{name}' here.{did_you_mean(name, _known_keys(model, detail['loc'][:-1]))}"
        case "literal_error":
            expected = str(detail.get("ctx", {}).get("expected", "")).replace(" or ", ", ")
            return (
                f"'{detail['input']}' is not"
                f" allowed.{did_you_mean(str(detail['input']), (word.strip(chr(39)) for word in expected.split(', ')))}"
            )
        case "missing":
            return "is required but not given"
        case "model_type" | "dict_type":
            return f"expected a mapping, got {detail['input']!r}"
        case _:
            message, shown = detail["msg"].removeprefix("Value error, "), repr(detail["input"])
            return message if shown in message or len(shown) > 60 else f"{message} (got {shown})"


def _known_keys(model: type[BaseModel], loc: Iterable[str | int]) -> set[str]:
    """Return the keys that `model` allows at `loc`, read from its JSON schema, where unions and nested models
    are all alike.
    """
    root = model.model_json_schema()
    here = list(_branches(root, root))
    for part in loc:
        children = [child for branch in here for child in _children(branch, part)]
        # no children: `part` names a branch of a union
        here = [branch for child in children for branch in _branches(child, root)] or here
    return {key for branch in here for key in branch.get("properties", {})}


def _children(branch: dict[str, Any], part: str | int) -> Iterator[dict[str, Any]]:
    """Yield the schemas of what stands under `part` in a mapping or a list."""
    properties: dict[str, Any] = branch.get("properties", {})
    patterns: dict[str, Any] = branch.get("patternProperties", {})
    candidates: list[Any] = (
        [properties[part]]
        if part in properties
        else [branch.get("additionalProperties"), *patterns.values(), branch.get("items")]
    )
    return (cast("dict[str, Any]", schema) for schema in candidates if isinstance(schema, dict))


def _branches(schema: dict[str, Any], root: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield the alternatives of `schema`, with references followed."""
    if "$ref" in schema:
        yield from _branches(root["$defs"][schema["$ref"].rpartition("/")[2]], root)
    elif alternatives := schema.get("anyOf") or schema.get("oneOf"):
        for alternative in alternatives:
            yield from _branches(alternative, root)
    else:
        yield schema
