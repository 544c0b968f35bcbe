"""An FMU's modelDescription.xml as ports and start values, without loading the FMU itself."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from engines.fmu.bond_params import FmuBond
from engines.fmu.bond_variables import BondVariables, find_bond
from engines.fmu.clock import Clock, clock_of
from engines.fmu.model import interface_of, read_model, suggested_tolerance
from engines.fmu.sources import listed_sources
from engines.fmu.start import Start, declared_start, given_start, settable, size_of, unit_of
from engines.fmu.terminals import matched_bond, read_terminals
from engines.fmu.texts import MESSAGES, TextVariable
from engines.fmu.tunable import tunable_parameters
from engines.fmu.variables import Variable, number_type, port_name
from hub.participant import signal_in, signal_out
from schemas.errors import ScenarioError, did_you_mean
from schemas.ports import Port
from schemas.ros import Float64Message, Float64MultiArray

if TYPE_CHECKING:
    from fmpy.model_description import CoSimulation, InterfaceType, ModelDescription, ModelVariable

__all__ = ["Description", "describe"]

_log = logging.getLogger(__name__)

MOST_ELEMENTS = 1_000_000
"""Most elements of an array. A larger array in a port would fill the memory of all hosts at every step."""


@dataclass(frozen=True)
class Description:
    """Description of an FMU for co-simulation here."""

    path: Path
    major: int
    """Major version of FMI: 2 or 3."""
    guid: str
    """FMI 2: guid; FMI 3: instantiation token."""
    interface: InterfaceType
    """Model identifier and capability flags of what is used."""
    co_simulation: CoSimulation | None
    """The same for co-simulation; None: model exchange is used."""
    inputs: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    ports: tuple[Port, ...]
    starts: tuple[Start, ...]
    """The scenario's start values, in the form for the FMU."""
    sources: tuple[str, ...] = ()
    """C files of the library, compiled where there is none for this platform."""
    bonds: tuple[BondVariables, ...] = ()
    """The scenario's bonds; their inputs are neither `inputs` nor `ports`."""
    text_inputs: tuple[TextVariable, ...] = ()
    text_outputs: tuple[TextVariable, ...] = ()
    """Inputs and outputs that are texts or bytes."""
    tunable: tuple[Variable, ...] = ()
    """Parameters that may change while the session runs."""
    clocks: tuple[Clock, ...] = ()
    """Input and output clocks, of an FMU with an event mode."""
    states: int = 0
    """For model exchange: number of continuous states (FMI 2)."""
    indicators: int = 0
    """For model exchange: number of event indicators (FMI 2)."""
    completes_steps: bool = False
    """For model exchange: whether the FMU wants to know of completed steps."""
    tolerance: float | None = None
    """Relative tolerance suggested by the FMU."""


def describe(
    path: Path,
    start: Mapping[str, Any],
    *,
    strict: bool = True,
    solver: str | None = None,
    bonds: Mapping[str, FmuBond] = MappingProxyType({}),
    tunable: Mapping[str, Sequence[Any] | None] = MappingProxyType({}),
) -> Description:
    """Read the FMU at `path`.

    Args:
        path: the FMU.
        start: start values by FMU variable name, in the variables' units.
        strict: whether a modelDescription.xml with a broken rule of FMI is refused.
        solver: `cvode` for model exchange although there is co-simulation; None: by what there is.
        bonds: bonds by name.
        tunable: limits of parameters that may change while the session runs, by name.

    Raises ScenarioError, and MissingExtraError without FMPy.
    """
    model, major, names = read_model(path, strict=strict)
    part = interface_of(path, model, major, names, solver)
    starts = {value.name: value for value in _starts(path, model, major, start)}
    clocks = _clocks(path, model, part)
    variables: dict[str, list[Variable]] = {"input": [], "output": []}
    texts: dict[str, list[TextVariable]] = {"input": [], "output": []}
    ports: list[Port] = []
    for row in model.modelVariables:
        if row.causality not in variables or row.alias is not None:
            continue
        if row.type in MESSAGES and not row.dimensions and not (clocks and row.clocks):
            text = TextVariable(row.name, port_name(row.name), row.valueReference, row.type)
            texts[row.causality].append(text)
            ports.append(_text_port(row, text))
            continue
        variable = _variable(path, row, major, _size(path, row, start), clocked=bool(clocks))
        if variable is not None:
            variables[row.causality].append(variable)
            ports.append(_port(row, variable, _input_start(path, row, variable, starts, strict=strict)))
    found = list(_bonds(path, bonds, model.modelVariables, variables))
    bonded = _bonded_inputs(found)
    numbers = {name: float(one.value[0]) for name, one in starts.items() if not isinstance(one.value, bytes)}
    tuned = list(tunable_parameters(path, model.modelVariables, major, tunable, numbers))
    return Description(
        path,
        major,
        model.guid,
        part,
        model.coSimulation if part is model.coSimulation else None,
        tuple(variable for variable in variables["input"] if variable.name not in bonded),
        tuple(variables["output"]),
        (
            *(port for port in ports if port.name not in bonded.values()),
            *(port for _, port in tuned),
            *(port for clock in clocks for port in clock.ports),
        ),
        tuple(starts.values()),
        listed_sources(model),
        tuple(found),
        tuple(texts["input"]),
        tuple(texts["output"]),
        tuple(variable for variable, _ in tuned),
        clocks,
        model.numberOfContinuousStates,
        model.numberOfEventIndicators,
        completes_steps=bool(model.modelExchange and model.modelExchange.needsCompletedIntegratorStep),
        tolerance=suggested_tolerance(model),
    )


def _clocks(path: Path, model: ModelDescription, part: InterfaceType) -> tuple[Clock, ...]:
    """Return the clocks that can tick here.

    Raises ScenarioError for clocks of known times without an event mode, in which they would tick.
    """
    try:
        clocks = tuple(clock for row in model.modelVariables if (clock := clock_of(row)) is not None)
    except (ValueError, ZeroDivisionError) as error:
        raise ScenarioError(f"'{path}': a clock has times that are no numbers: {error}") from error
    if wrong := [one.name for one in clocks if one.interval is not None and not one.interval > 0.0]:
        raise ScenarioError(f"'{path}': clocks with an interval that is not above 0: {', '.join(wrong)}")
    if model.coSimulation is not None and part is model.coSimulation and model.coSimulation.hasEventMode:
        return clocks
    if timed := [clock.name for clock in clocks if clock.is_timed]:
        raise ScenarioError(
            f"'{path}' has time-based input clocks ({', '.join(timed)}), and no event mode in"
            " co-simulation to let them tick. Export it for co-simulation with event mode, or without clocks."
        )
    return ()


def _bonds(
    path: Path,
    bonds: Mapping[str, FmuBond],
    rows: Sequence[ModelVariable],
    variables: Mapping[str, Sequence[Variable]],
) -> Iterator[BondVariables]:
    terminals = read_terminals(path) if any(one.terminal for one in bonds.values()) else {}
    for name, one in bonds.items():
        bond, sign = matched_bond(path, name, one, terminals, rows)
        yield find_bond(path, name, bond, rows, variables, sign)


def _bonded_inputs(bonds: Sequence[BondVariables]) -> dict[str, str]:
    """Return the port names of the bonds' inputs by variable. Raises ScenarioError for an input set twice."""
    bonded: dict[str, str] = {}
    for bond in bonds:
        for variable in bond.inputs:
            if variable.name in bonded:
                raise ScenarioError(
                    f"input '{variable.name}' is set twice by bonds", path=("bonds", bond.side.name)
                )
            bonded[variable.name] = variable.port
    return bonded


def _size(path: Path, row: ModelVariable, start: Mapping[str, Any]) -> int:
    """Return the number of elements of a variable. Raises ScenarioError for none or too many."""
    try:
        size = size_of(row, start)
    except (TypeError, ValueError):  # of given structural parameters `_starts` has taken care
        size = -1
    if not 0 <= size <= MOST_ELEMENTS:
        raise ScenarioError(
            f"'{path}': the dimensions of variable '{row.name}' (line {row.sourceline}) are no numbers whose"
            f" product is at most {MOST_ELEMENTS}"
        )
    return size


def _input_start(
    path: Path, row: ModelVariable, variable: Variable, starts: Mapping[str, Start], *, strict: bool
) -> tuple[float, ...] | None:
    if row.causality != "input":
        return None
    if row.name in starts:
        return tuple(np.asarray(starts[row.name].value, np.float64).tolist())
    try:
        return declared_start(row, variable.size)
    except ValueError as error:
        problem = (
            f"input '{row.name}' (line {row.sourceline}) has the start value {row.start!r:.80}, no number"
        )
        if strict:
            raise ScenarioError(
                f"'{path}': modelDescription.xml breaks a rule of FMI: {problem}. Export the FMU again with a"
                " corrected one, or load it all the same with 'strict: false' and connect the input."
            ) from error
        _log.warning("%s: modelDescription.xml breaks a rule of FMI: %s", path, problem)
        return None


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


def _variable(path: Path, row: ModelVariable, major: int, size: int, *, clocked: bool) -> Variable | None:
    number = number_type(major, row.type)
    if row.type == "Clock" and clocked:
        return None
    if number is None or size == 0:
        reason = (
            "it is empty"
            if number
            else f"it is an array of type {row.type}, or clocked"
            if row.type in MESSAGES
            else f"it is a {row.type}, which goes by its ticks"
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
        clocks=tuple(one.valueReference for one in row.clocks or ()) if clocked else (),
    )


def _about(row: ModelVariable) -> str:
    text = f"FMU variable '{row.name}' ({row.type})"
    return f"{text}: {' '.join(row.description.split())}" if row.description else text


def _text_port(row: ModelVariable, variable: TextVariable) -> Port:
    """Return the port of a text or of bytes; an input that is not connected keeps the FMU's own value."""
    type_ = MESSAGES[variable.type]
    if row.causality == "input":
        return signal_in(variable.port, type_, _about(row), start=())
    return signal_out(variable.port, type_, _about(row))


def _port(row: ModelVariable, variable: Variable, start: tuple[float, ...] | None) -> Port:
    text = _about(row)
    type_ = Float64MultiArray if row.dimensions else Float64Message
    declare = signal_in if row.causality == "input" else signal_out
    return declare(variable.port, type_, text, size=variable.size, unit=unit_of(row), start=start)
