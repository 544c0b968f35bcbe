"""What a page may change of a scenario: numbers, words and devices.

What would import a class or read a file is the command line's alone.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

from hub.planning import registry
from hub.planning.foreign_code import names_class
from hub.planning.parameter_paths import parameter_paths
from hub.planning.scenario_source import Source
from schemas.errors import MessageError
from schemas.scenario import Scenario

__all__ = ["WORD", "require_harmless"]

WORD = re.compile(r"[\w .,+-]*")
"""Texts of a page: names, words, durations such as `1.5 s`."""


def require_harmless(scenario: Scenario, changes: list[str]) -> None:
    """Raise MessageError if changes name a class or a file; nothing is imported that is not installed."""
    tree: dict[str, Any] = scenario.model_dump(mode="json")
    before, source = _files(tree), Source(Path("scenario.json"), tree, {})
    for change in changes:
        source.override(change)
        value = change.partition("=")[2]
        for text in _texts(_at(source, change)):
            if not WORD.fullmatch(text):
                raise MessageError(
                    f"--set {value[:80]}: from a page only numbers and words are taken, no classes and no"
                    f" paths; use the command line"
                )
    if more := _files(source.tree) - before:
        raise MessageError(f"'{min(more)[:80]}' is a file or a class: from a page none is taken")


def _at(source: Source, change: str) -> Any:
    """Return the value that a change has set."""
    (path,) = [path for path, text in source.overrides.items() if text == change][-1:]
    value: Any = source.tree
    for part in path:
        value = value[part]
    return value


def _files(tree: dict[str, Any]) -> set[str]:
    """Return the classes and the paths that participants name."""
    found: set[str] = set()
    participants = cast("dict[str, dict[str, Any]]", tree["participants"])
    shared = cast("dict[str, Any]", tree.get("scene") or {})
    for spec in participants.values():
        kind = str(spec.get("kind"))
        if names_class(kind):
            found.add(kind)
        elif kind in registry.kinds():
            model = registry.load(kind).params_model
            for params in (shared, spec):
                found |= parameter_paths(model, params)
                found |= {str(params[name]) for name in model.native_code if params.get(name) is not None}
    return found


def _texts(value: Any) -> Iterator[str]:
    """Yield every text in a value, the keys of mappings included."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for key, part in cast("dict[Any, Any]", value).items():
            yield str(key)
            yield from _texts(part)
    elif isinstance(value, list):
        for part in cast("list[Any]", value):
            yield from _texts(part)
