"""The FMUs of a system: unpacked, read and held against the connectors of their components."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from engines.fmu.description import Description, describe
from engines.fmu.model import read_model
from engines.fmu.ssp.package import Document
from engines.fmu.ssp.structure import FMU, Component, System
from engines.fmu.ssp.units import Unit, model_units
from engines.fmu.start import settable, unit_of
from schemas.errors import ScenarioError, did_you_mean

if TYPE_CHECKING:
    from fmpy.model_description import ModelDescription, ModelVariable

__all__ = ["MODEL_EXCHANGE", "RESOURCES", "Fmu", "Variable", "load_fmus"]

RESOURCES = "resources"
"""Folder of the FMUs, in an archive of a system and beside an imported scenario."""
MODEL_EXCHANGE = "ModelExchange"
"""Implementation of a component for which a solver is needed."""
_UNSAFE = re.compile(r"[^A-Za-z0-9_.-]")


@dataclass(frozen=True)
class Variable:
    """A variable of an FMU."""

    row: ModelVariable
    unit: Unit | None
    """None: the variable has no unit."""
    items: Mapping[str, int]
    """Values of its enumeration by name."""

    @property
    def causality(self) -> str:
        """FMI's causality."""
        return str(self.row.causality or "local")

    @property
    def is_settable(self) -> bool:
        """Whether the variable takes a start value."""
        return settable(self.row)


@dataclass(frozen=True)
class Fmu:
    """An FMU of a component."""

    file: Path
    model: ModelDescription
    variables: Mapping[str, Variable]
    """Variables by name."""
    ports: frozenset[str]
    """Names of inputs and outputs that are ports."""
    strict: bool
    """False: the FMU's description breaks a rule of FMI in a way that leaves something undefined."""

    @property
    def step_s(self) -> float:
        """Step of the FMU's default experiment, s; 0: not stated."""
        experiment = self.model.defaultExperiment
        try:
            step = float(experiment.stepSize or 0.0) if experiment else 0.0
        except ValueError:
            return 0.0
        return step if 0.0 < step < float("inf") else 0.0

    def describe(self, start: Mapping[str, object]) -> Description:
        """Return inputs, outputs and checked start values. Raises ScenarioError."""
        return describe(self.file, start, strict=self.strict)


def load_fmus(system: System, directory: Path, lost: Callable[[str], None]) -> dict[tuple[str, ...], Fmu]:
    """Unpack the FMUs of all components into `directory`; return the FMUs by the path of the component.

    A component that is no FMU is reported to `lost`. Raises ScenarioError for a missing or refused FMU, and
    for a connector that contradicts the FMU.
    """
    read: dict[Document, Fmu] = {}
    fmus: dict[tuple[str, ...], Fmu] = {}
    for component in system.components():
        what = f"{component.place}: component '{component.label}'"
        if problem := _no_fmu(component):
            lost(f"{what} {problem}, with all its connections")
            continue
        document = component.document.resolve(component.source, what)
        if document not in read:
            file = directory / _file_name(document.name, {fmu.file.name for fmu in read.values()})
            with file.open("wb") as target:
                document.package.extract(document.name, target)
            read[document] = _read(file, what, lost)
        fmus[component.path] = fmu = read[document]
        _check_implementation(component, fmu, what)
        _check_connectors(component, fmu)
    return fmus


def _check_implementation(component: Component, fmu: Fmu, what: str) -> None:
    has = {"CoSimulation": fmu.model.coSimulation, MODEL_EXCHANGE: fmu.model.modelExchange}
    if component.implementation != "any" and not has.get(component.implementation):
        raise ScenarioError(
            f"{what}: implementation '{component.implementation}' of the FMU '{fmu.file.name}'; it has"
            f" {', '.join(name for name in has if has[name]) or 'none that runs here'}"
        )


def _no_fmu(component: Component) -> str:
    if not component.source:
        return "has no source: it is a place without an implementation"
    if component.type != FMU:
        return f"is of type '{component.type}'; FMUs ('{FMU}') and systems are read"
    return ""


def _file_name(name: str, taken: set[str]) -> str:
    path = PurePosixPath(name)
    stem = _UNSAFE.sub("_", path.stem).lstrip(".-")[:100] or "fmu"
    number, file = 1, f"{stem}.fmu"
    while file in taken:
        number += 1
        file = f"{stem}_{number}.fmu"
    return file


def _read(file: Path, what: str, lost: Callable[[str], None]) -> Fmu:
    strict = True
    try:
        try:
            description = describe(file, {})
        except ScenarioError:
            strict = False
            description = describe(file, {}, strict=False)
            lost(f"{what}: rules of FMI that its modelDescription.xml breaks are ignored (strict: false)")
        model, _, _ = read_model(file, strict=strict)
    except ScenarioError as error:
        raise ScenarioError(f"{what}: {error}") from error
    units = model_units(model)
    variables: dict[str, Variable] = {}
    for row in model.modelVariables:
        unit = unit_of(row)
        items = row.declaredType.items if row.declaredType else []
        variables[row.name] = Variable(
            row,
            units.get(unit, Unit(unit)) if unit else None,
            {item.name: int(item.value) for item in items if item.value is not None},
        )
    return Fmu(file, model, variables, frozenset(port.name for port in description.ports), strict)


def _check_connectors(component: Component, fmu: Fmu) -> None:
    """Raise ScenarioError for a connector without a variable, of another kind, or in another unit."""
    for connector in component.connectors.values():
        what = f"{connector.place}: connector '{connector.name}' of component '{component.label}'"
        variable = fmu.variables.get(connector.name)
        if variable is None:
            hint = did_you_mean(connector.name, fmu.variables)
            raise ScenarioError(f"{what} is no variable of the FMU '{fmu.file.name}'.{hint}")
        if connector.kind not in {variable.causality, "unspecified", "inout"}:
            raise ScenarioError(
                f"{what} is of kind '{connector.kind}', the FMU's variable of causality"
                f" '{variable.causality}'"
            )
        if connector.unit and variable.unit and not connector.unit.is_same(variable.unit):
            raise ScenarioError(
                f"{what} is in '{connector.unit.name}', the FMU's variable in '{variable.unit.name}': a"
                " connector of an FMU has the unit of its variable, by name and definition"
            )
