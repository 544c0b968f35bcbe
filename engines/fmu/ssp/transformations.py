"""Transformations of values on their way from one connector to another."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from engines.fmu.ssp.xml_file import Node
from schemas.errors import ScenarioError, did_you_mean

__all__ = ["Linear", "Table", "Transformation", "compose", "read_transformation"]

_BOOLEANS = {"true": 1, "1": 1, "false": 0, "0": 0}


@dataclass(frozen=True)
class Linear:
    """`factor * value + offset`."""

    factor: float = 1.0
    offset: float = 0.0

    @property
    def is_identity(self) -> bool:
        """Whether values stay."""
        return (self.factor, self.offset) == (1.0, 0.0)

    def apply(self, value: float) -> float:
        """Return a value transformed."""
        return value if self.is_identity else self.factor * value + self.offset


@dataclass(frozen=True)
class Table:
    """Whole numbers by whole numbers; a number without an entry stays."""

    entries: Mapping[int, int] = field(default_factory=dict[int, int])
    is_identity = False

    def apply(self, value: float) -> float:
        """Return a value transformed."""
        return self.entries.get(int(value), value) if float(value).is_integer() else value


Transformation = Linear | Table


def compose(first: Transformation, then: Transformation) -> Transformation:
    """Return both transformations as one. Raises ValueError for a table beside a factor or an offset."""
    if first.is_identity:
        return then
    if then.is_identity:
        return first
    if isinstance(first, Linear) and isinstance(then, Linear):
        return Linear(then.factor * first.factor, then.factor * first.offset + then.offset)
    if isinstance(first, Table) and isinstance(then, Table):
        keys = [*first.entries, *then.entries]
        return Table({key: int(then.apply(first.apply(key))) for key in keys})
    raise ValueError("a table after a factor or an offset, or the reverse, is not one conversion")


def read_transformation(
    parent: Node, source_items: Mapping[str, int], target_items: Mapping[str, int]
) -> Transformation:
    """Return the transformation among the children of a connection or a mapping entry.

    `source_items` and `target_items` are the enumerations at both ends, values by name. Raises ScenarioError.
    """
    for node in parent.children:
        match node.name:
            case "ssc:LinearTransformation":
                return Linear(node.number("factor", 1.0), node.number("offset", 0.0))
            case "ssc:BooleanMappingTransformation":
                return Table(_entries(node, _BOOLEANS, _BOOLEANS))
            case "ssc:IntegerMappingTransformation":
                return Table(_entries(node, None, None))
            case "ssc:EnumerationMappingTransformation":
                return Table(_entries(node, source_items, target_items))
            case _:
                pass
    return Linear()


def _entries(
    parent: Node, sources: Mapping[str, int] | None, targets: Mapping[str, int] | None
) -> dict[int, int]:
    entries: dict[int, int] = {}
    for node in parent.all("ssc:MapEntry"):
        source, target = _whole(node, "source", sources), _whole(node, "target", targets)
        if source in entries:
            raise ScenarioError(f"{node.place}: two entries map '{node.get('source')}'")
        entries[source] = target
    return entries


def _whole(node: Node, attribute: str, names: Mapping[str, int] | None) -> int:
    text: Any = node.require(attribute)
    if names is not None:
        if text not in names:
            raise ScenarioError(
                f"{node.place}: {attribute}='{text}' is no value here.{did_you_mean(text, names)}"
            )
        return names[text]
    try:
        return int(text)
    except ValueError as error:
        raise ScenarioError(f"{node.place}: {attribute}='{text}' is no whole number") from error
