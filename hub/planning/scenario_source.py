"""The text of a scenario: the YAML tree, where each value of it stands, and what the command line put over
it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from schemas.errors import ScenarioError

__all__ = ["Location", "Source", "read"]

Location = tuple[str | int, ...]
"""Keys and list indices from the root of the scenario."""

_Mark = tuple[int, int]
_MERGE = "tag:yaml.org,2002:merge"


@dataclass(frozen=True)
class Source:
    """Where a scenario came from, and where in it each value stands."""

    file: Path
    tree: dict[str, Any]
    marks: dict[Location, tuple[_Mark, _Mark]]
    """Line and column, from 1, of each key (list items: of the item) and of its value."""
    overrides: dict[Location, str] = field(default_factory=dict[Location, str])
    """The values set on the command line, and what was written there."""

    @property
    def directory(self) -> Path:
        """Where relative paths of the scenario start."""
        return self.file.resolve().parent

    def line(self, path: Location, message: str, *, key: bool = False) -> str:
        """Return `FILE:LINE:COL: path: message` for the value at `path` (or its key); what is missing is
        shown where it belongs.
        """
        return f"{self._where(path, key)}: {'.'.join(map(str, path)) or 'scenario'}: {message}"

    def override(self, text: str) -> None:
        """Apply `a.b.c=value`. Mappings on the way that are not there are made, and judged by the validation."""
        dotted, equals, value_text = text.partition("=")
        if not equals or not all(dotted.split(".")):
            raise ScenarioError(f"--set {text}: expected a.b.c=value")
        try:
            value = _yaml().load(value_text)
        except YAMLError as error:
            raise ScenarioError(f"--set {text}: the value is not valid YAML") from error
        path: Location = tuple(int(part) if part.isdecimal() else part for part in dotted.split("."))
        parent: Any = self.tree
        for depth, part in enumerate(path):
            if problem := _no_such_part(parent, part):
                raise ScenarioError(
                    f"--set {text}: {'.'.join(map(str, path[:depth])) or 'the scenario'} {problem}"
                )
            last = depth == len(path) - 1
            if last or (isinstance(parent, dict) and part not in parent):
                cast("dict[Any, Any]", parent)[part] = value if last else {}
                self.overrides[path[: depth + 1]] = text
            parent = cast("dict[Any, Any]", parent)[part]

    def rename(self, parent: Location, old: str, new: str) -> None:
        """Call the value at `old` of the mapping at `parent` `new`; messages about it still find its place."""
        mapping: Any = self.tree
        for part in parent:
            mapping = mapping[part]
        mapping[new] = mapping.pop(old)
        self.stands_also_at((*parent, old), (*parent, new))

    def stands_also_at(self, written: Location, path: Location) -> None:
        """Find the values below `path` where those below `written` are, unless they have a place of their own."""
        for places in (self.marks, self.overrides):
            found = {
                (*path, *at[len(written) :]): place
                for at, place in places.items()
                if at[: len(written)] == written
            }
            for at, place in found.items():
                cast("dict[Location, Any]", places).setdefault(at, place)

    def _where(self, path: Location, key: bool) -> str:
        for length in range(len(path), -1, -1):
            known = path[:length]
            if known in self.overrides:
                return f"--set {self.overrides[known]}"
            if known in self.marks:
                line, column = self.marks[known][0 if key and length == len(path) else 1]
                return f"{self.file}:{line}:{column}"
        return str(self.file)


def read(file: Path) -> Source:
    """Return the scenario text in `file`.

    Raises ScenarioError if it cannot be read or is not one YAML mapping.
    """
    try:
        text = file.read_text(encoding="utf-8")
        tree: Any = _copied(_yaml().load(text))
        root: Any = _yaml().compose(text)
        marks = {} if root is None else dict(_marks(root, root, ()))
    except MarkedYAMLError as error:
        detail: Any = error
        mark = detail.problem_mark
        where = f":{mark.line + 1}:{mark.column + 1}" if mark else ""
        raise ScenarioError(
            f"{file}{where}: not valid YAML:"
            f" {detail.problem}{f' ({detail.context})' if detail.context else ''}"
        ) from error
    except (OSError, UnicodeDecodeError, YAMLError) as error:
        raise ScenarioError(f"{file}: cannot be read: {error}") from error
    except RecursionError:
        raise ScenarioError(
            f"{file}: nested too deeply: does an alias (*name) stand inside what it is an alias of?"
        ) from None
    if not isinstance(tree, dict):
        raise ScenarioError(
            f"{file}:1:1: a scenario is a mapping with at least the keys name, step and participants"
        )
    return Source(file, cast("dict[str, Any]", tree), marks)


def _yaml() -> Any:
    return YAML(typ="safe", pure=True)


def _marks(key: Any, value: Any, path: Location) -> Iterator[tuple[Location, tuple[_Mark, _Mark]]]:
    """Yield where each value below a YAML node stands, the place that counts last: a key of one's own goes
    before a merged one.
    """
    if value.id == "mapping":
        for merged in _merged(value):
            yield from _marks(key, merged, path)
    # `key:` without a value: the parser is already on the next line
    empty = value.start_mark.index == value.end_mark.index
    yield path, (_mark(key), _mark(key if empty else value))
    if value.id == "mapping":
        for name, child in value.value:
            if name.tag != _MERGE:
                yield from _marks(name, child, (*path, name.value))
    elif value.id == "sequence":
        for index, child in enumerate(value.value):
            yield from _marks(child, child, (*path, index))


def _merged(mapping: Any) -> Iterator[Any]:
    """Yield the nodes that `<<` merges into a mapping; of several that have a key the first one counts, so it
    comes last.
    """
    for name, child in mapping.value:
        if name.tag == _MERGE:
            yield from reversed(child.value) if child.id == "sequence" else (child,)


def _copied(value: Any) -> Any:
    """Return a YAML tree in which no part is shared: what an alias stands for can then be overridden in one
    place alone.
    """
    if isinstance(value, dict):
        return {key: _copied(part) for key, part in cast("dict[Any, Any]", value).items()}
    return [_copied(part) for part in cast("list[Any]", value)] if isinstance(value, list) else value


def _mark(node: Any) -> _Mark:
    return node.start_mark.line + 1, node.start_mark.column + 1


def _no_such_part(parent: Any, part: str | int) -> str:
    if isinstance(parent, list):
        length = len(parent)  # pyright: ignore[reportUnknownArgumentType]
        return (
            ""
            if isinstance(part, int) and part < length
            else f"is a list of {length}, counted from 0; there is no '{part}' in it"
        )
    return "" if isinstance(parent, dict) else f"is '{parent}', which has no parts"
