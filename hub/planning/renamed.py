"""Names of version 0.1.0 that scenarios may still use in this release."""

from __future__ import annotations

import logging
from typing import Any, cast

from hub.planning.scenario_source import Location, Source

__all__ = ["KINDS", "SCENARIOS", "current_names", "replace_old_names"]

log = logging.getLogger(__name__)

KINDS = {"console": "dvrk-console", "paper": "vrep"}
SCENARIOS = {"ros-paper": "ros-vrep"}
_PARTICIPANT_KEYS = {"link": "network_link"}


def current_names(scenario: dict[str, Any]) -> dict[str, Any]:
    """Return a recorded scenario in the names of this version."""
    participants = {
        name: {_PARTICIPANT_KEYS.get(key, key): value for key, value in spec.items()}
        | {"kind": KINDS.get(spec["kind"], spec["kind"])}
        for name, spec in scenario["participants"].items()
    }
    return scenario | {"participants": participants}


def replace_old_names(source: Source) -> None:
    """Replace old names in the text of a scenario, each with a warning that says where it stands."""
    participants = source.tree.get("participants")
    for name, spec in cast("dict[str, Any]", participants if isinstance(participants, dict) else {}).items():
        if not isinstance(spec, dict):
            continue
        known = cast("dict[str, Any]", spec)
        for old, new in _PARTICIPANT_KEYS.items():
            if old in known and new not in known:
                _warn(source, ("participants", name, old), f"'{old}' is now '{new}'", key=True)
                source.rename(("participants", name), old, new)
        kind = known.get("kind")
        if isinstance(kind, str) and kind in KINDS:
            _warn(source, ("participants", name, "kind"), f"kind '{kind}' is now '{KINDS[kind]}'")
            known["kind"] = KINDS[kind]


def _warn(source: Source, path: Location, renamed: str, *, key: bool = False) -> None:
    log.warning(source.line(path, f"{renamed}; the old name is accepted in this release only", key=key))
