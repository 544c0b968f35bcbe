"""The kinds of participants that are installed, found by entry points and loaded by name.

A package brings its own kinds by an entry point in one of the groups `trocar.engines`, `trocar.controllers` and
`trocar.devices`. If it has an extra of the same name as a kind, the kind needs that extra to run.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib.metadata import Distribution, EntryPoint, PackageNotFoundError, distribution, entry_points

from packaging.requirements import Requirement

from hub.participant import Device, Stepped
from schemas.errors import MissingExtraError, ScenarioError, did_you_mean

__all__ = ["GROUPS", "Kind", "Participant", "broken", "installed_packages", "kinds", "load", "missing_packages", "require_extra"]

Participant = type[Stepped] | type[Device]

GROUPS = {"trocar.engines": "engine", "trocar.controllers": "controller", "trocar.devices": "device"}
"""Entry-point group to role."""


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
                raise ScenarioError(f"kind '{kind.name}' is brought by both '{other.distribution}' and '{kind.distribution}': uninstall one of them")
            found[kind.name] = kind
    return found


@cache
def load(name: str) -> Participant:
    """Return the class of kind `name`. Raises ScenarioError if there is no such kind or its package cannot be imported."""
    try:
        kind = kinds()[name]
    except KeyError:
        raise ScenarioError(f"unknown kind '{name}'.{did_you_mean(name, kinds())}") from None
    try:
        loaded = kind.entry.load()
    except Exception as error:  # whatever a plugin's module does on import
        raise ScenarioError(
            f"{kind.role} '{name}' of '{kind.distribution}' cannot be loaded from {kind.entry.value}: {type(error).__name__}: {error}"
        ) from error
    if not (isinstance(loaded, type) and issubclass(loaded, Device if kind.role == "device" else Stepped)):
        raise ScenarioError(f"{kind.role} '{name}' of '{kind.distribution}': {kind.entry.value} is no {'Device' if kind.role == 'device' else 'Stepped'}")
    return loaded


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
    kind = kinds()[name]
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
