"""The code named by a scenario beside installed kinds: classes on PYTHONPATH, and files of native code."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import Any, cast

from hub.planning import registry
from schemas.errors import ScenarioError

__all__ = ["foreign_code", "names_class"]


def names_class(kind: str) -> bool:
    """Return whether a kind is a `module:Class` to import, not a kind of an installed package."""
    return ":" in kind and kind not in registry.kinds()


def foreign_code(specs: Iterable[Mapping[str, Any]], scene: object) -> list[str]:
    """Return the classes and the files named by participants, without an import of any.

    Args:
        specs: The participants, each with a kind.
        scene: The scene of the scenario; may have parameters for participants.
    """
    shared = cast("dict[str, Any]", scene) if isinstance(scene, dict) else {}
    code: set[str] = set()
    for spec in specs:
        kind = spec["kind"]
        if names_class(kind):
            code.add(kind)
            continue
        with suppress(ScenarioError):  # an unknown kind, which the validation of the scenario reports
            native = registry.load(kind).params_model.native_code
            code |= {str(path) for name in native if (path := spec.get(name, shared.get(name))) is not None}
    return sorted(code)
