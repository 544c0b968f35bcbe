"""The values of a scenario for pages to change: numbers, switches and choices of permitting kinds."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any, Literal, NamedTuple

import annotated_types
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from hub.planning import registry
from hub.planning.limits import safe_text
from schemas.errors import ScenarioError
from schemas.scenario import Scenario

__all__ = ["Field", "Scalar", "override_text", "participant_fields", "session_fields"]

Scalar = bool | int | float | str | None
Control = Literal["number", "whole", "switch", "choice"]

_OF_SESSION = ("duration", "step", "window")
"""Fields of the scenario itself; pace and recording have controls of their own."""


class Field(NamedTuple):
    """A value for pages to change, and its control in a form."""

    path: str
    """Place of the value, as on the command line."""
    label: str
    control: Control
    unit: str
    choices: list[Any]
    about: str
    default: Any
    """Default value; None without a default, or if the default depends on further values."""
    limits: dict[str, Any]
    """`least` and `most` of a number, in the field's unit."""

    def override(self, value: Scalar) -> str:
        """Return `path=value` as on the command line; raises ScenarioError for a value of another type."""
        text = override_text(self.path, value)
        if value is None or self._allows_value(value):
            return text
        expected = {
            "number": f"a number in {self.unit}" if self.unit else "a number",
            "whole": "a whole number",
            "switch": "true or false",
            "choice": f"one of {', '.join(map(str, self.choices))}",
        }
        raise ScenarioError(f"--set {safe_text(text)}: {self.path}: expected {expected[self.control]}")

    def _allows_value(self, value: bool | float | str) -> bool:
        match self.control:
            case "switch":
                return isinstance(value, bool)
            case "choice":
                return value in self.choices and not isinstance(value, bool)
            case "whole":
                return isinstance(value, int) and not isinstance(value, bool)
            case "number":
                return isinstance(value, int | float) and not isinstance(value, bool)

    def in_unit(self, value: Any) -> Any:
        """Return a validated value in the unit of the field: durations are whole nanoseconds."""
        is_duration = self.control == "number" and self.unit == "s" and isinstance(value, int)
        return value * 1e-9 if is_duration else value


def override_text(path: str, value: Scalar) -> str:
    """Return `path=value` as on the command line."""
    return f"{path}={json.dumps(value)}"


def session_fields() -> Iterator[Field]:
    """Yield the fields of a scenario itself."""
    return (field for field in _fields(Scenario, "") if field.path in _OF_SESSION)


def participant_fields(name: str, kind: str) -> Iterator[Field]:
    """Yield the fields of a participant; none if the kind is not installed or does not permit changes."""
    if kind in registry.kinds():
        model = registry.load(kind).params_model
        if vars(model).get("open_to_pages"):  # a derived model does not inherit it
            yield from _fields(model, f"{name}.")


def _fields(model: type[BaseModel], prefix: str) -> Iterator[Field]:
    described = model.model_json_schema()["properties"]
    for name, info in model.model_fields.items():
        schema = described[info.alias or name]
        control = _form_control(schema)
        if control is None:
            continue
        field = Field(
            path=f"{prefix}{name}",
            label=name,
            control=control,
            unit=_find(schema, "unit") or "",
            choices=_find(schema, "enum") or [],
            about=info.description or "",
            default=None if info.default is PydanticUndefined else info.default,
            limits={},
        )
        yield field._replace(limits={name: field.in_unit(bound) for name, bound in _limits(info)})


def _form_control(schema: dict[str, Any]) -> Control | None:
    """Return the control of a value; None for words, paths, lists, mappings and a single choice."""
    if "const" in schema:
        return None
    if _find(schema, "enum"):
        return "choice"
    types = {one.get("type") for one in (schema, *schema.get("anyOf", ()))}
    if _find(schema, "unit") or "number" in types:
        return "number"
    if types <= {"boolean", "null", None} and "boolean" in types:
        return "switch"
    return "whole" if types <= {"integer", "null", None} and "integer" in types else None


def _find(schema: dict[str, Any], key: str) -> Any:
    """Return the value of a key in a schema or in an alternative of the schema; None if absent."""
    return next((one[key] for one in (schema, *schema.get("anyOf", ())) if key in one), None)


def _limits(info: FieldInfo) -> Iterator[tuple[str, Any]]:
    """Yield `least` and `most` of a field; an excluded limit is the model's to reject."""
    for one in info.metadata:
        match one:
            case annotated_types.Ge(bound) | annotated_types.Gt(bound):
                yield "least", bound
            case annotated_types.Le(bound) | annotated_types.Lt(bound):
                yield "most", bound
            case _:
                pass
