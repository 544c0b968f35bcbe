"""YAML text within limits: checked during parsing, before any value is built."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.constructor import ConstructorError, SafeConstructor
from ruamel.yaml.error import MarkedYAMLError
from ruamel.yaml.events import (
    CollectionEndEvent,
    CollectionStartEvent,
    MappingStartEvent,
    NodeEvent,
    ScalarEvent,
)
from ruamel.yaml.parser import Parser

from hub.planning.limits import MAX_BYTES, MAX_DEPTH, MAX_ITEMS, MAX_NUMBER, MAX_TEXT, MAX_VALUES

__all__ = ["MERGE", "LimitError", "compose_yaml", "construct_yaml"]

MERGE = "tag:yaml.org,2002:merge"
_STRING, _NUMBERS = "tag:yaml.org,2002:str", ("tag:yaml.org,2002:int", "tag:yaml.org,2002:float")
_UNPRINTABLE = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff]")
"""Control characters except tab and line end, and halves of surrogate pairs: no file, key or terminal accepts
these.
"""


class LimitError(MarkedYAMLError):
    """Valid YAML not allowed in a scenario: too long, too deep, or not a text."""

    def __init__(self, problem: str, mark: Any) -> None:
        parent: Any = super()
        parent.__init__(problem=problem, problem_mark=mark)


def compose_yaml(text: str) -> Any:
    """Return the root node of a YAML text, or None if empty. Raises YAMLError, including LimitError."""
    size = len(text.encode(errors="replace"))
    if size > MAX_BYTES:
        raise LimitError(f"the text has {size} bytes; at most {MAX_BYTES} are allowed", None)
    yaml = _create_parser()
    yaml.composer.warn_double_anchors = False
    try:
        root = yaml.compose(text)
    except ValueError as error:  # of a directive such as %YAML 99999...
        raise LimitError(str(error), None) from error
    if root is not None:
        _measure(root, {})
    return root


def construct_yaml(root: Any) -> Any:
    """Return the value of a node from `compose_yaml`. Raises YAMLError."""
    return None if root is None else _create_parser().constructor.construct_document(root)


def _create_parser() -> Any:
    yaml: Any = YAML(typ="safe", pure=True)
    yaml.Parser, yaml.Constructor = _BoundedParser, _Constructor
    return yaml


class _BoundedParser(Parser):
    """Checks each event before a node is built."""

    def __init__(self, loader: Any) -> None:
        parent: Any = super()
        parent.__init__(loader)
        self._values = 0
        self._left: list[int] = []
        """Further nodes allowed in each open list or mapping."""

    def get_event(self) -> Any:
        """Return the next event. Raises LimitError if the event is too many, too deep or too long."""
        parent: Any = super()
        event: Any = parent.get_event()
        if isinstance(event, NodeEvent):
            self._count(event)
        if isinstance(event, ScalarEvent):
            _check_text(event)
        elif isinstance(event, CollectionStartEvent):
            # a mapping has two nodes for each item
            self._left.append(MAX_ITEMS * (2 if isinstance(event, MappingStartEvent) else 1))
            self._check_depth(event)
        elif isinstance(event, CollectionEndEvent):
            self._left.pop()
        return event

    def _check_depth(self, event: Any) -> None:
        if len(self._left) > MAX_DEPTH:
            raise LimitError(f"nested too deeply: at most {MAX_DEPTH} levels are allowed", event.start_mark)

    def _count(self, event: Any) -> None:
        self._values += 1
        if self._values > MAX_VALUES:
            raise LimitError(f"more than {MAX_VALUES} keys and values are not allowed", event.start_mark)
        if self._left:
            self._left[-1] -= 1
            if self._left[-1] < 0:
                raise LimitError(
                    f"a list or mapping of more than {MAX_ITEMS} items is not allowed", event.start_mark
                )


class _Constructor(SafeConstructor):
    """Reports a value that does not fit the tag, such as `!!int x` or the date 2001-99-99, with the place."""

    def construct_object(self, node: Any, deep: bool = False) -> Any:
        """Return the value of `node`. Raises ConstructorError."""
        parent: Any = super()
        try:
            return parent.construct_object(node, deep=deep)
        except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError) as error:
            kind = str(node.tag).rpartition(":")[2]
            raise ConstructorError(problem=f"not a valid {kind}", problem_mark=node.start_mark) from error


def _check_text(event: Any) -> None:
    if len(event.value) > MAX_TEXT:
        raise LimitError(
            f"a text of {len(event.value)} characters; at most {MAX_TEXT} are allowed", event.start_mark
        )
    if found := _UNPRINTABLE.search(event.value):
        raise LimitError(
            f"the character U+{ord(found[0]):04X} is not allowed in a text: only tabs, line ends and"
            " printable characters are",
            event.start_mark,
        )


@dataclass(frozen=True)
class _Extent:
    """Size of a node with aliases written out."""

    values: int
    characters: int
    depth: int


def _measure(node: Any, known: dict[int, _Extent | None]) -> _Extent:
    """Return the extent of `node`, and raise LimitError if the node or a key inside is not allowed.

    `known` holds the extents by the identity of the node, None while a node is being measured. Anchors come
    before their aliases, so the recursion is never deeper than the text.
    """
    if id(node) in known:
        extent = known[id(node)]
        if extent is None:
            raise LimitError(
                "nested too deeply: an alias (*name) is used inside its own anchor (&name)", node.start_mark
            )
        return extent
    known[id(node)] = None
    if node.id == "scalar":
        extent = _scalar_extent(node)
    else:
        children: list[_Extent] = []
        for part in node.value:
            if node.id == "mapping":
                _check_key(part[0])
            children += [_measure(child, known) for child in (part if node.id == "mapping" else (part,))]
        extent = _Extent(
            1 + sum(child.values for child in children),
            sum(child.characters for child in children),
            1 + max((child.depth for child in children), default=0),
        )
    for number, allowed, what in (
        (extent.values, MAX_VALUES, "keys and values"),
        (extent.characters, MAX_BYTES, "characters"),
        (extent.depth, MAX_DEPTH, "levels"),
    ):
        if number > allowed:
            raise LimitError(
                f"more than {allowed} {what} are not allowed, aliases (*name) written out", node.start_mark
            )
    known[id(node)] = extent
    return extent


def _scalar_extent(node: Any) -> _Extent:
    length = len(node.value)
    if str(node.tag) in _NUMBERS and length > MAX_NUMBER:
        raise LimitError(
            f"a number of {length} characters; at most {MAX_NUMBER} are allowed", node.start_mark
        )
    return _Extent(1, length, 0)


def _check_key(key: Any) -> None:
    if key.id != "scalar" or str(key.tag) not in (_STRING, _NUMBERS[0], MERGE):
        raise LimitError("a key must be a text: write it in quotes", key.start_mark)
