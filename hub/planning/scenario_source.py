"""The text of a scenario: YAML tree, place of each value in the file, and overrides."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

from ruamel.yaml.error import MarkedYAMLError, YAMLError

from hub.planning.limits import MAX_BYTES, MAX_DEPTH, MAX_TEXT, safe_text
from hub.planning.yaml_text import MERGE, LimitError, compose_yaml, construct_yaml
from schemas.errors import ScenarioError
from schemas.scenario import Scenario

__all__ = ["Location", "Source", "merge_missing", "read"]

Location = tuple[str | int, ...]
"""Keys and list indices from the root of the scenario."""

_Mark = tuple[int, int]


@dataclass(frozen=True)
class Source:
    """The tree of a scenario, and the place of each value in the file or on the command line."""

    file: Path
    tree: dict[str, Any]
    marks: dict[Location, tuple[_Mark, _Mark]]
    """Line and column, counted from 1, of each key (for a list item: of the item) and of the value."""
    text: str = ""
    """Contents of the file."""
    overrides: dict[Location, str] = field(default_factory=dict[Location, str])
    """The values set on the command line, each with the text of the override."""
    _written: dict[Location, Location] = field(default_factory=dict[Location, Location])
    """The source part of values copied from another part of the scenario."""

    @property
    def directory(self) -> Path:
        """Where relative paths of the scenario start."""
        return self.file.resolve().parent

    def line(self, path: Location, message: str, *, key: bool = False) -> str:
        """Return `FILE:LINE:COL: path: message` about the value at `path`, or about the key."""
        where = safe_text(".".join(map(str, path))) or "scenario"
        return f"{self.place(path, key=key)}: {where}: {safe_text(message, 2000)}"

    def place(self, path: Location, *, key: bool = False) -> str:
        """Return `FILE:LINE:COL`, or the override, of the value at `path`, or of the key.

        The place of a missing value is the place of the enclosing mapping or list.
        """
        for length in range(len(path), -1, -1):
            for known in self._copy_sources(path[:length]):
                if known in self.overrides:
                    return f"--set {safe_text(self.overrides[known])}"
                if known in self.marks:
                    line, column = self.marks[known][0 if key and length == len(path) else 1]
                    return f"{self.file}:{line}:{column}"
        return str(self.file)

    def _copy_sources(self, path: Location) -> Iterator[Location]:
        """Yield `path`, then the possible sources of a copied value at `path`."""
        yield path
        for length in range(len(path), 0, -1):
            if (written := self._written.get(path[:length])) is not None:
                yield from self._copy_sources((*written, *path[length:]))

    def override(self, text: str) -> None:
        """Apply `a.b.c=value`. Missing mappings on the way are created; validated later.

        `participants.` may be left out before a participant's name.

        Raises ScenarioError if the text has another form, or names a part of a value without parts.
        """
        dotted, equals, value_text = text.partition("=")
        if len(dotted) > MAX_TEXT or dotted.count(".") >= MAX_DEPTH:
            raise ScenarioError(
                f"--set {safe_text(text)}: at most {MAX_TEXT} characters and {MAX_DEPTH} parts are allowed"
                " before the '='"
            )
        if not equals or not all(dotted.split(".")):
            raise ScenarioError(f"--set {safe_text(text)}: expected a.b.c=value")
        if not dotted.isprintable():
            raise ScenarioError(
                f"--set {safe_text(text)}: only printable characters are allowed before the '='"
            )
        try:
            value = construct_yaml(compose_yaml(value_text))
        except LimitError as error:
            detail: Any = error
            raise ScenarioError(f"--set {safe_text(text)}: {detail.problem}") from error
        except YAMLError as error:
            raise ScenarioError(f"--set {safe_text(text)}: the value is not valid YAML") from error
        path: Location = tuple(_key_or_index(part) for part in dotted.split("."))
        names = self.tree.get("participants")
        if path[0] not in Scenario.model_fields and isinstance(names, dict) and path[0] in names:
            path = ("participants", *path)
        parent: Any = self.tree
        for depth, part in enumerate(path):
            if problem := _no_such_part(parent, part):
                raise ScenarioError(
                    f"--set {safe_text(text)}: {'.'.join(map(str, path[:depth])) or 'the scenario'} {problem}"
                )
            last = depth == len(path) - 1
            if last or (isinstance(parent, dict) and part not in parent):
                cast("dict[Any, Any]", parent)[part] = value if last else {}
                self.overrides[path[: depth + 1]] = text
            parent = cast("dict[Any, Any]", parent)[part]

    def stands_also_at(self, written: Location, path: Location) -> None:
        """Give the values below `path` without places the places of the values below `written`."""
        self._written[path] = written


def read(file: Path) -> Source:
    """Return the scenario text in `file`.

    Raises ScenarioError if the file cannot be read or is not a single YAML mapping.
    """
    try:
        text = _text(file)
        root = compose_yaml(text)
        marks = {} if root is None else dict(_marks(root, root, ()))
        tree: Any = _copy_unshared(construct_yaml(root))
    except MarkedYAMLError as error:
        detail: Any = error
        mark = detail.problem_mark
        where = f":{mark.line + 1}:{mark.column + 1}" if mark else ""
        invalid = "" if isinstance(error, LimitError) else "not valid YAML: "
        context = f" ({detail.context})" if detail.context else ""
        raise ScenarioError(
            f"{file}{where}: {invalid}{safe_text(f'{detail.problem}{context}', 500)}"
        ) from error
    except (OSError, UnicodeDecodeError, YAMLError) as error:
        raise ScenarioError(f"{file}: cannot be read: {safe_text(str(error), 500)}") from error
    if not isinstance(tree, dict):
        raise ScenarioError(
            f"{file}:1:1: a scenario is a mapping with at least the keys name, step and participants"
        )
    return Source(file, cast("dict[str, Any]", tree), marks, text)


def _text(file: Path) -> str:
    """Return the text of a file, read up to the size limit of a scenario."""
    with file.open("rb") as opened:
        data = opened.read(MAX_BYTES + 1)
    if len(data) > MAX_BYTES:
        raise LimitError(f"the file is larger than {MAX_BYTES} bytes, which a scenario may have", None)
    return data.decode("utf-8").replace("\r\n", "\n").replace("\r", "\n")


def _key_or_index(part: str) -> str | int:
    """Return a part of the path of an override; a longer number cannot be an index."""
    return int(part) if part.isdecimal() and len(part) < 10 else part


def _marks(key: Any, value: Any, path: Location) -> Iterator[tuple[Location, tuple[_Mark, _Mark]]]:
    """Yield the place of each value below a YAML node; of two for the same path, the last counts."""
    if value.id == "mapping":
        for other in _merged_nodes(value):  # first: a mapping's own keys replace those it merges
            yield from _marks(key, other, path)
    # `key:` without a value: the parser is already on the next line
    empty = value.start_mark.index == value.end_mark.index
    yield path, (_mark_node(key), _mark_node(key if empty else value))
    if value.id == "mapping":
        for name, child in value.value:
            if name.tag != MERGE:
                yield from _marks(name, child, (*path, name.value))
    elif value.id == "sequence":
        for index, child in enumerate(value.value):
            yield from _marks(child, child, (*path, index))


def _merged_nodes(mapping: Any) -> Iterator[Any]:
    """Yield the nodes merged by `<<` into a mapping, the highest priority last."""
    for name, child in mapping.value:
        if name.tag == MERGE:
            # YAML gives the first of several mappings priority
            yield from reversed(child.value) if child.id == "sequence" else (child,)


def _copy_unshared(value: Any) -> Any:
    """Return a YAML tree without shared parts, so that an override changes a single place."""
    if isinstance(value, dict):
        return {key: _copy_unshared(part) for key, part in cast("dict[Any, Any]", value).items()}
    return [_copy_unshared(part) for part in cast("list[Any]", value)] if isinstance(value, list) else value


def merge_missing(value: Any, over: Any) -> Any:
    """Return `over`, and if both are mappings, also the entries missing in `over`, at any depth."""
    if not (isinstance(value, dict) and isinstance(over, dict)):
        return over
    below, above = cast("dict[str, Any]", value), cast("dict[str, Any]", over)
    return below | {
        key: merge_missing(below[key], part) if key in below else part for key, part in above.items()
    }


def _mark_node(node: Any) -> _Mark:
    return node.start_mark.line + 1, node.start_mark.column + 1


def _no_such_part(parent: Any, part: str | int) -> str:
    if isinstance(parent, list):
        length = len(cast("list[Any]", parent))
        known = isinstance(part, int) and part < length
        return "" if known else f"is a list of {length}, counted from 0; there is no '{part}' in it"
    return "" if isinstance(parent, dict) else f"is '{safe_text(str(parent))}', which has no parts"
