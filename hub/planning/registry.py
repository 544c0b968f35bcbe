"""The installed kinds of participants, found by entry points and loaded by name.

A package adds kinds with entry points in the groups `trocar.engines`, `trocar.controllers` and
`trocar.devices`. If the package has an extra with the name of a kind, the kind needs the extra's packages.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import Distribution, EntryPoint, PackageNotFoundError, distribution, entry_points
from inspect import isabstract
from typing import Any, Literal

from packaging.requirements import Requirement

from hub.participant import Device, Params, Stepped
from hub.planning.limits import MAX_KIND, safe_text
from schemas.errors import MissingExtraError, ScenarioError, did_you_mean

__all__ = [
    "GROUPS",
    "UNPACKAGED",
    "Kind",
    "Participant",
    "Role",
    "broken_kinds",
    "extra_packages",
    "find",
    "installed_packages",
    "kinds",
    "load",
    "missing_packages",
    "require_extra",
]

Participant = type[Stepped] | type[Device]
Role = Literal["engine", "controller", "device"]

GROUPS: dict[str, Role] = {
    "trocar.engines": "engine",
    "trocar.controllers": "controller",
    "trocar.devices": "device",
}
"""Entry-point group to role."""

UNPACKAGED = "PYTHONPATH"
"""Stands for the distribution of a kind named `module:Class`."""


@dataclass(frozen=True)
class Kind:
    """A kind of participant as declared by the package, without an import of the package."""

    name: str
    role: Role
    distribution: str
    entry: EntryPoint


@cache
def kinds() -> dict[str, Kind]:
    """Return every installed kind by name. Raises ScenarioError if two distributions share a kind."""
    found: dict[str, Kind] = {}
    for group, role in GROUPS.items():
        for entry in sorted(entry_points(group=group), key=lambda e: (e.name, e.value)):
            distribution = _name(entry.dist) if entry.dist else "an unnamed distribution"
            kind = Kind(entry.name, role, distribution, entry)
            other = found.get(kind.name)
            if other:
                raise ScenarioError(
                    f"both '{other.distribution}' and '{kind.distribution}' have a kind '{kind.name}':"
                    " uninstall one of them"
                )
            found[kind.name] = kind
    return found


@cache
def _name(dist: Distribution) -> str:
    """Return the name of a distribution; the metadata are parsed anew at each call."""
    return dist.name


def find(name: str) -> Kind:
    """Return the kind called `name`: an installed kind, or `module:Class` for a class on PYTHONPATH.

    Raises ScenarioError if there is no such kind, or if the class cannot be imported.
    """
    if name in kinds():
        return kinds()[name]
    if ":" in name:
        module = name.partition(":")[0]
        if len(name) > MAX_KIND:
            raise ScenarioError(f"a kind of {len(name)} characters; at most {MAX_KIND} are allowed")
        if "__main__" in module.split("."):
            raise ScenarioError(
                f"kind '{name}': '{module}' is a program, which runs when it is imported; name the module"
                " that defines the class"
            )
        kind = Kind(name, "engine", UNPACKAGED, EntryPoint(name, name, "trocar.engines"))
        loaded = _import_kind(kind)  # without an entry point, only the class says which role it has
        is_device = isinstance(loaded, type) and issubclass(loaded, Device)
        return replace(kind, role="device") if is_device else kind
    raise ScenarioError(f"unknown kind '{safe_text(name)}'.{did_you_mean(name, kinds())}")


@cache
def load(name: str) -> Participant:
    """Return the class of kind `name`.

    Raises ScenarioError if there is no such kind or the package cannot be imported.
    """
    kind = find(name)
    loaded = _import_kind(kind)
    base = Device if kind.role == "device" else Stepped
    if not (isinstance(loaded, type) and issubclass(loaded, base)):
        raise ScenarioError(
            f"{kind.role} '{name}' of '{kind.distribution}': {kind.entry.value} is no subclass of"
            f" {base.__name__}"
        )
    model: object = getattr(loaded, "params_model", None)
    if isabstract(loaded) or not (isinstance(model, type) and issubclass(model, Params)):
        missing = ", ".join(sorted(getattr(loaded, "__abstractmethods__", ()))) or "params_model"
        raise ScenarioError(
            f"{kind.role} '{name}' of '{kind.distribution}': {kind.entry.value} is an abstract class: it"
            f" does not define {missing}"
        )
    return loaded


def _import_kind(kind: Kind) -> Any:
    try:
        return kind.entry.load()
    except (Exception, SystemExit) as error:  # a module may raise anything on import
        module = kind.entry.module.partition(".")[0]
        unknown = isinstance(error, ModuleNotFoundError) and error.name == module
        remedy = f"; state where {module}.py is: PYTHONPATH=DIR trocar ..." if unknown else ""
        raise ScenarioError(
            f"{kind.role} '{kind.name}' of '{kind.distribution}' cannot be loaded from {kind.entry.value}:"
            f" {type(error).__name__}: {error}{remedy}"
        ) from error


def broken_kinds() -> dict[str, str]:
    """Return the kinds that cannot be loaded, each with the reason."""
    reasons: dict[str, str] = {}
    for name in kinds():
        try:
            load(name)
        except ScenarioError as error:
            reasons[name] = str(error)
    return reasons


def require_extra(name: str) -> None:
    """Raise MissingExtraError if a package of the extra of kind `name` is not installed."""
    kind = find(name)
    for package in missing_packages(kind.entry.dist, name):
        raise MissingExtraError(f"{kind.role} '{name}'", name, package, kind.distribution)


def extra_packages(name: str) -> list[str]:
    """Return the names of the packages in the extra of kind `name`; empty without an extra."""
    return sorted({requirement.name for requirement in _extra_requirements(find(name).entry.dist, name)})


def missing_packages(dist: Distribution | None, extra: str) -> list[str]:
    """Return the packages of `extra` of a distribution not installed here."""
    return [f"{r.name}{r.specifier}" for r in _extra_requirements(dist, extra) if not _is_installed(r)]


def installed_packages(dist: Distribution, extra: str) -> list[str]:
    """Return the packages of `extra` of a distribution installed here, with their versions."""
    return [
        f"{r.name} {distribution(r.name).version}"
        for r in _extra_requirements(dist, extra)
        if _is_installed(r)
    ]


@cache
def _extra_requirements(dist: Distribution | None, extra: str) -> tuple[Requirement, ...]:
    """Return the requirements of an extra. Markers are slow, and each scenario asks for its kinds anew."""
    found: list[Requirement] = []
    for requirement in _all_requirements(dist) if dist else ():
        marker = requirement.marker
        if not marker or marker.evaluate({"extra": ""}) or not marker.evaluate({"extra": extra}):
            continue
        if dist and requirement.name == _name(dist):  # an extra that consists of others
            for part in sorted(requirement.extras):
                found += _extra_requirements(dist, part)
        else:
            found.append(requirement)
    return tuple(found)


@cache
def _all_requirements(dist: Distribution) -> tuple[Requirement, ...]:
    return _parse_requirements(tuple(dist.requires or ()))


@cache
def _parse_requirements(texts: tuple[str, ...]) -> tuple[Requirement, ...]:
    """Return parsed requirements; each group of entry points has a separate object for a distribution."""
    return tuple(Requirement(text) for text in texts)


def _is_installed(requirement: Requirement) -> bool:
    try:
        version = distribution(requirement.name).version
    except PackageNotFoundError:
        return False
    return requirement.specifier.contains(version, prereleases=True)
