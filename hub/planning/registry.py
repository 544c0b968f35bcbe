"""The kinds of participants that are installed, found by entry points and loaded by name.

A package brings its own kinds by an entry point in one of the groups `trocar.engines`, `trocar.controllers`
and `trocar.devices`. If it has an extra of the same name as a kind, the kind needs that extra to run.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import Distribution, EntryPoint, PackageNotFoundError, distribution, entry_points
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement
from pydantic import ValidationError

from hub.participant import Device, Stepped
from schemas.errors import MissingExtraError, ScenarioError, did_you_mean

__all__ = [
    "GROUPS",
    "UNPACKAGED",
    "Kind",
    "Participant",
    "broken",
    "find",
    "installed_packages",
    "kinds",
    "load",
    "make",
    "missing_packages",
    "require_extra",
]

Participant = type[Stepped] | type[Device]

GROUPS = {"trocar.engines": "engine", "trocar.controllers": "controller", "trocar.devices": "device"}
"""Entry-point group to role."""

UNPACKAGED = "PYTHONPATH"
"""Stands for the distribution of a kind that is named `module:Class`."""


@dataclass(frozen=True)
class Kind:
    """A kind of participant as its package declares it; nothing of it is imported yet."""

    name: str
    role: str
    """`engine`, `controller` or `device`."""
    distribution: str
    entry: EntryPoint


@cache
def kinds() -> dict[str, Kind]:
    """Return every installed kind by name. Raises ScenarioError if two distributions bring the same one."""
    found: dict[str, Kind] = {}
    for group, role in GROUPS.items():
        for entry in sorted(entry_points(group=group), key=lambda e: (e.name, e.value)):
            kind = Kind(entry.name, role, entry.dist.name if entry.dist else "an unnamed distribution", entry)
            other = found.get(kind.name)
            if other:
                raise ScenarioError(
                    f"kind '{kind.name}' is brought by both '{other.distribution}' and '{kind.distribution}':"
                    " uninstall one of them"
                )
            found[kind.name] = kind
    return found


def find(name: str) -> Kind:
    """Return the kind called `name`: an installed one, or `module:Class` for a class of one's own on
    PYTHONPATH.

    Raises ScenarioError if there is none, or if that class cannot be imported.
    """
    if name in kinds():
        return kinds()[name]
    if ":" in name:
        kind = Kind(name, "engine", UNPACKAGED, EntryPoint(name, name, "trocar.engines"))
        loaded = _import(kind)  # only the class itself says what it is
        return (
            replace(kind, role="device") if isinstance(loaded, type) and issubclass(loaded, Device) else kind
        )
    raise ScenarioError(f"unknown kind '{name}'.{did_you_mean(name, kinds())}")


@cache
def load(name: str) -> Participant:
    """Return the class of kind `name`.

    Raises ScenarioError if there is no such kind or its package cannot be imported.
    """
    kind = find(name)
    loaded = _import(kind)
    if not (isinstance(loaded, type) and issubclass(loaded, Device if kind.role == "device" else Stepped)):
        raise ScenarioError(
            f"{kind.role} '{name}' of '{kind.distribution}': {kind.entry.value} is no"
            f" {'Device' if kind.role == 'device' else 'Stepped'}"
        )
    return loaded


def _import(kind: Kind) -> Any:
    try:
        return kind.entry.load()
    except Exception as error:  # whatever a plugin's module does on import
        raise ScenarioError(
            f"{kind.role} '{kind.name}' of '{kind.distribution}' cannot be loaded from {kind.entry.value}:"
            f" {type(error).__name__}: {error}"
        ) from error


def make(name: str, participant: str, params: Mapping[str, Any], directory: Path) -> Stepped | Device:
    """Return a participant of kind `name`; relative paths in its parameters start at `directory`.

    Raises ScenarioError if the kind cannot be loaded or the parameters are none of it.
    """
    kind = load(name)
    try:
        checked = kind.params_model.model_validate(params, context={"directory": directory})
    except ValidationError as error:
        raise ScenarioError(f"participant '{participant}' of kind '{name}': {error}") from error
    return kind(participant, checked)


def broken() -> dict[str, str]:
    """Return the kinds that cannot be loaded, each with the reason."""
    reasons: dict[str, str] = {}
    for name in kinds():
        try:
            load(name)
        except ScenarioError as error:
            reasons[name] = str(error)
    return reasons


def require_extra(name: str) -> None:
    """Raise MissingExtraError if kind `name` belongs to an extra of which a package is not installed."""
    kind = find(name)
    for package in missing_packages(kind.entry.dist, name):
        raise MissingExtraError(f"{kind.role} '{name}'", name, package, kind.distribution)


def missing_packages(dist: Distribution | None, extra: str) -> list[str]:
    """Return the packages of `extra` of a distribution that are not installed here."""
    return [f"{r.name}{r.specifier}" for r in _requirements(dist, extra) if not _installed(r)]


def installed_packages(dist: Distribution, extra: str) -> list[str]:
    """Return the packages of `extra` of a distribution that are installed here, with their versions."""
    return [f"{r.name} {distribution(r.name).version}" for r in _requirements(dist, extra) if _installed(r)]


def _requirements(dist: Distribution | None, extra: str) -> Iterator[Requirement]:
    for text in (dist and dist.requires) or ():
        requirement = Requirement(text)
        marker = requirement.marker
        if not marker or marker.evaluate({"extra": ""}) or not marker.evaluate({"extra": extra}):
            continue
        if dist and requirement.name == dist.name:  # an extra that is the sum of others
            for part in sorted(requirement.extras):
                yield from _requirements(dist, part)
        else:
            yield requirement


def _installed(requirement: Requirement) -> bool:
    try:
        version = distribution(requirement.name).version
    except PackageNotFoundError:
        return False
    return requirement.specifier.contains(version, prereleases=True)
