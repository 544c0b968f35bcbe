"""Contacts between tools and tissue: made from `touches`, and missing where a tool passes through."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from pydantic import ValidationError

from hub.participant import Params, Surface, TissueParams, Tool, ToolParams
from hub.planning.scenario_source import Source, merge_missing
from schemas.errors import ScenarioError, did_you_mean
from schemas.scenario import Bond, PortReference

__all__ = ["MissingContact", "add_contacts", "missing_contacts"]


@dataclass(frozen=True)
class MissingContact:
    """A tool within reach of a body, without a bond between the two participants."""

    participant: str
    """Participant with the tool."""
    tool: Tool
    body: str
    surface: Surface

    @property
    def remedy(self) -> str:
        """Lines to add to the scenario, or what to change."""
        if not self.tool.bond:
            return "Its instrument has no contact spheres: choose another, or accept it."
        arm = self.tool.path[1]
        return f"To let them touch, add\nscene:\n  arms:\n    {arm}: {{touches: [{self.body}]}}"


def add_contacts(source: Source, params: Mapping[str, Params]) -> list[str]:
    """Add the probe and the bond of every tool with `touches`; return the participants with a new probe.

    A probe of that name, stated by the scenario, completes the numbers of the tool. A tool with a bond keeps
    its bond.

    Raises ScenarioError for a tool without contact, or for a body that is not there.
    """
    changed: list[str] = []
    for robot, tool in _tools(params):
        path = ("participants", robot, *tool.path)
        if not tool.touches or _is_bonded(source.tree.get("bonds"), robot, tool):
            continue
        if not tool.bond:
            raise ScenarioError("this instrument has no contact spheres: it touches nothing", path=path)
        tissue = _tissue_of(tool, params, path)
        home = cast("TissueParams", params[tissue])
        if tool.is_spare and not home.bears_exchanges:
            raise ScenarioError(
                f"'{tissue}' does not bear an exchange of instruments: take kind fem, or leave out `spares`",
                path=path,
            )
        _add_probe(source.tree["participants"][tissue], tool, home.unused_of_tools)
        bonds = cast("list[Any]", source.tree.get("bonds") or [])
        source.tree["bonds"] = bonds
        source.stands_also_at(path, ("bonds", len(bonds)))
        bonds.append({"motion": f"{robot}.{tool.bond}", "force": f"{tissue}.{tool.name}"})
        changed.append(tissue)
    return changed


def missing_contacts(params: Mapping[str, Params], bonds: Sequence[Bond]) -> list[MissingContact]:
    """Return the tools that reach a body, by distance alone, and pass through for want of a bond."""
    return [
        MissingContact(robot, tool, body, surface)
        for robot, tool in _tools(params)
        if not any(bond.motion == PortReference(participant=robot, port=tool.bond) for bond in bonds)
        for one in params.values()
        if isinstance(one, TissueParams)
        for body, surface in one.bodies.items()
        if np.linalg.norm(surface.nodes - tool.base[:3, 3], axis=1).min() <= tool.reach
    ]


def _tools(params: Mapping[str, Params]) -> Iterator[tuple[str, Tool]]:
    for name, one in params.items():
        if isinstance(one, ToolParams):
            yield from ((name, tool) for tool in one.tools)


def _tissue_of(tool: Tool, params: Mapping[str, Params], path: tuple[str | int, ...]) -> str:
    """Return the participant with all bodies that the tool touches."""
    homes = {
        body: name for name, one in params.items() if isinstance(one, TissueParams) for body in one.bodies
    }
    for body in tool.touches:
        if body not in homes:
            raise ScenarioError(f"there is no organ '{body}'.{did_you_mean(body, homes)}", path=path)
    if len(found := sorted({homes[body] for body in tool.touches})) > 1:
        raise ScenarioError(
            f"organs of {' and '.join(found)}: an instrument touches the organs of one participant", path=path
        )
    return found[0]


def _add_probe(tissue: dict[str, Any], tool: Tool, unused: frozenset[str]) -> None:
    probes = cast("dict[str, Any]", tissue.get("probes") or {})
    own = {key: value for key, value in tool.probe.items() if key not in unused}
    tissue["probes"] = probes | {tool.name: merge_missing(own, probes.get(tool.name) or {})}


def _is_bonded(bonds: Any, robot: str, tool: Tool) -> bool:
    """Return whether the scenario, not validated yet, has a bond of the tool."""
    for bond in cast("list[Any]", bonds if isinstance(bonds, list) else []):
        try:
            motion = PortReference.model_validate(cast("dict[str, Any]", bond)["motion"])
        except (ValidationError, TypeError, KeyError):  # the validation of the scenario reports it
            continue
        if motion == PortReference(participant=robot, port=tool.bond):
            return True
    return False
