"""Opens a scenario to programs: a gateway for `trocar.connect`, beside the leads of the scenario."""

from __future__ import annotations

from typing import Any, cast

from hub.planning.scenario_source import Source
from schemas.errors import ScenarioError

__all__ = ["admit_programs"]

_NAME = "programs"
"""Name and kind of the gateway."""
_GATEWAYS = (_NAME, "ros2-zenoh")
"""Kinds that show arms to programs."""


def admit_programs(source: Source) -> None:
    """Add a participant `programs` with its connections to motion controller and endoscope.

    A scenario with such a gateway stays as it is. Raises ScenarioError if no participant executes the
    commands of programs.
    """
    tree = source.tree
    participants, connections = tree.get("participants"), tree.get("connections", [])
    if not isinstance(participants, dict) or not isinstance(connections, list):
        return  # the validation of the scenario says so
    first: dict[str, tuple[str, dict[str, Any]]] = {}
    for name, given in cast("dict[str, Any]", participants).items():
        if isinstance(given, dict):
            spec = cast("dict[str, Any]", given)
            first.setdefault(str(spec.get("kind")), (name, spec))
    if any(kind in first for kind in _GATEWAYS):
        return
    if "motion" not in first:
        raise ScenarioError(
            "--programs: this scenario has no participant of kind motion, which executes the commands of"
            " programs. `trocar run psm` has one"
        )
    motion, controller = first["motion"]
    added = [f"{_NAME}.* -> {motion}.*", f"{motion}.* -> {_NAME}.*"]
    endoscope, camera = first.get("endoscope", ("", {"images": "none"}))
    if camera.get("images") != "none":
        added.append(f"{endoscope}.* -> {_NAME}.endoscope/*")
    frames = {"reference": controller["reference"]} if "reference" in controller else {}
    participants[_NAME] = {"kind": _NAME, **frames}
    tree["connections"] = [*cast("list[Any]", connections), *added]
