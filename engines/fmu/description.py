"""An FMU's modelDescription.xml as ports and start values, without loading the FMU itself."""

from __future__ import annotations

import logging
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from engines.fmu.start import Start, declared_start, given_start, settable, size_of, unit_of
from engines.fmu.variables import Variable, number_type, port_name
from schemas.errors import MissingExtraError, ScenarioError, did_you_mean
from schemas.ports import Port
from schemas.ros import Float64Message, Float64MultiArray

if TYPE_CHECKING:
    from fmpy.model_description import CoSimulation, ModelDescription, ModelVariable

__all__ = ["Description", "describe"]

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Description:
    """An FMU that can be co-simulated here."""

    path: Path
    major: int
    """Major version of FMI: 2 or 3."""
    guid: str
    """FMI 2: guid; FMI 3: instantiation token."""
    co_simulation: CoSimulation
    """Model identifier and capability flags."""
    inputs: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    ports: tuple[Port, ...]
    starts: tuple[Start, ...]
    """The start values that the scenario gives, as the FMU takes them."""


def describe(path: Path, start: Mapping[str, Any]) -> Description:
    """Read the FMU at `path`; `start` holds start values by FMU variable name, in the variables' units.

    Raises ScenarioError, and MissingExtraError without FMPy.
    """
    model = _read(path)
    major = int(model.fmiVersion.split(".")[0])
    co_simulation = _co_simulation(path, model, major)
    starts = {value.name: value for value in _starts(path, model, major, start)}
    variables: dict[str, list[Variable]] = {"input": [], "output": []}
    ports: list[Port] = []
    for row in model.modelVariables:
        if row.causality not in variables or row.alias is not None:
            continue
        variable = _variable(path, row, major, size_of(row, start))
        if variable is not None:
            variables[row.causality].append(variable)
            ports.append(_port(row, variable, _input_start(path, row, variable, starts)))
    return Description(
        path,
        major,
        model.guid,
        co_simulation,
        tuple(variables["input"]),
        tuple(variables["output"]),
        tuple(ports),
        tuple(starts.values()),
    )


def _input_start(
    path: Path, row: ModelVariable, variable: Variable, starts: Mapping[str, Start]
) -> tuple[float, ...] | None:
    if row.causality != "input":
        return None
    if row.name in starts:
        return tuple(np.asarray(starts[row.name].value, np.float64).tolist())
    try:
        return declared_start(row, variable.size)
    except ValueError as error:
        raise ScenarioError(
            f"'{path}': the FMU declares the start value '{row.start}' for '{row.name}': not a number"
        ) from error


def _read(path: Path) -> ModelDescription:
    try:
        from fmpy import read_model_description
        from fmpy.model_description import ValidationError
    except ImportError as error:
        raise MissingExtraError("engine 'fmu'", "fmu", "fmpy") from error
    if not path.is_file():
        raise ScenarioError(f"the FMU '{path}' does not exist")
    try:
        with path.open("rb") as file:  # given a path, FMPy leaves the file open if there is an error in it
            try:
                return read_model_description(file)
            except ValidationError as error:
                # tools write many FMUs that run well and break a rule of the schema
                _log.warning(
                    "%s: modelDescription.xml breaks rules of FMI: %s", path, "; ".join(error.problems)
                )
                return read_model_description(file, validate=False)
    except Exception as error:  # FMPy raises BadZipFile, KeyError, XMLSyntaxError, TypeError, bare Exception
        raise ScenarioError(f"'{path}' is no FMI 2.0 or 3.0 FMU: {type(error).__name__}: {error}") from error


def _co_simulation(path: Path, model: ModelDescription, major: int) -> CoSimulation:
    """Return the co-simulation part of the FMU.

    Raises ScenarioError if it has none that runs on this platform.
    """
    import fmpy

    if major not in (2, 3):
        raise ScenarioError(f"'{path}' is an FMI {model.fmiVersion} FMU; FMI 2.0 and 3.0 are allowed")
    if model.coSimulation is None:
        raise ScenarioError(
            f"'{path}' cannot be co-simulated: it is for model exchange or scheduled execution only. Export"
            " it for co-simulation."
        )
    clocks = [
        v.name
        for v in model.modelVariables
        if v.type == "Clock" and v.causality == "input" and v.intervalVariability != "triggered"
    ]
    if clocks:
        raise ScenarioError(
            f"'{path}' has time-based input clocks ({', '.join(clocks)}), which Trocar does not support."
            " Export it without clocks."
        )
    folder = fmpy.platform if major == 2 else fmpy.platform_tuple
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
    if f"binaries/{folder}/{model.coSimulation.modelIdentifier}{fmpy.sharedLibraryExtension}" not in names:
        found = {name.split("/")[1] for name in names if name.startswith("binaries/") and name.count("/") > 1}
        binaries = ", ".join(sorted(found)) or "none"
        raise ScenarioError(f"'{path}' has no binary for this platform, {folder}; it has: {binaries}")
    return model.coSimulation


def _starts(path: Path, model: ModelDescription, major: int, start: Mapping[str, Any]) -> Iterator[Start]:
    rows = {row.name: row for row in model.modelVariables if settable(row)}
    for name, given in start.items():
        if name not in rows:
            raise ScenarioError(
                f"'{path}' has no variable '{name}' that takes a start value.{did_you_mean(name, rows)}",
                path=("start", name),
            )
        try:
            yield given_start(rows[name], given, major, size_of(rows[name], start))
        except ValueError as error:
            raise ScenarioError(f"'{path}': {error}", path=("start", name)) from error


def _variable(path: Path, row: ModelVariable, major: int, size: int) -> Variable | None:
    number = number_type(major, row.type)
    if number is None or size == 0:
        reason = (
            "it is empty"
            if number
            else f"it is a {row.type}; only numbers and booleans are exchanged between participants"
        )
        _log.info("%s: %s '%s' becomes no port: %s", path, row.causality, row.name, reason)
        return None
    return Variable(
        row.name,
        port_name(row.name),
        row.valueReference,
        number,
        size,
        discrete=row.variability != "continuous",
    )


def _port(row: ModelVariable, variable: Variable, start: tuple[float, ...] | None) -> Port:
    return Port(
        name=variable.port,
        causality="input" if row.causality == "input" else "output",
        type=(Float64MultiArray if row.dimensions else Float64Message).ros_type,
        size=variable.size,
        unit=unit_of(row),
        start=start,
        description=f"FMU variable '{row.name}' ({row.type})"
        + (f": {row.description}" if row.description else ""),
    )
