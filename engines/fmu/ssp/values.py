"""Start values: the parameter bindings of all levels of a system, brought to the variables of its FMUs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from engines.fmu.ssp.fmus import Fmu, Variable
from engines.fmu.ssp.network import End, Wire
from engines.fmu.ssp.parameters import ParameterValue, read_binding
from engines.fmu.ssp.structure import Component, Element, System
from schemas.errors import ScenarioError, did_you_mean

__all__ = ["StartValues"]


class StartValues:
    """Start values by connector or variable; outer systems have priority, later bindings over earlier."""

    def __init__(
        self,
        system: System,
        fmus: Mapping[tuple[str, ...], Fmu],
        lost: Callable[[str], None],
    ) -> None:
        """Read all parameter bindings. Raises ScenarioError."""
        self._fmus = fmus
        self._lost = lost
        self._values: dict[End, ParameterValue] = {}
        self._apply(system)

    def _apply(self, element: Element) -> None:
        for inner in element.elements.values() if isinstance(element, System) else ():
            self._apply(inner)
        for binding in element.bindings:
            for name, value in read_binding(binding, element.label, self._lost):
                ends = self._find(element, name)
                if not ends:
                    self._lost(f"{value.place}: parameter '{name}' of '{element.label}' is no variable there")
                self._values |= dict.fromkeys(ends, value)

    def _find(self, element: Element, name: str) -> list[End]:
        """Return all variables with a hierarchical name; one name may mean several (SSP 2.0, 5.2.3)."""
        if isinstance(element, Component):
            fmu = self._fmus.get(element.path)
            return [End(element.path, name)] if fmu and name in fmu.variables else []
        if not isinstance(element, System):
            return []
        found = [End(element.path, name)] if name in element.connectors else []
        for inner in element.elements.values():
            if name.startswith(f"{inner.name}."):
                found += self._find(inner, name[len(inner.name) + 1 :])
        return found

    def follow(self, wires: Iterable[Wire]) -> None:
        """Hand values of systems' connectors without a source on to the FMUs. Raises ScenarioError."""
        for wire in wires:
            value = self._values.get(wire.source)
            if wire.source.path in self._fmus or value is None:
                continue
            try:
                if value.type in {"String", "Enumeration"} and not wire.change.is_identity:
                    raise ValueError(f"it is a {value.type}, which no connection transforms")
                if wire.unit and value.unit and not value.suppressed:
                    value = _in_unit(value, wire)
                self._values[wire.target] = value.through(wire.change)
            except ValueError as error:
                raise ScenarioError(
                    f"{value.place}: '{wire.source}' has a value unfit for '{wire.target}': {error}"
                ) from error

    def of(self, path: tuple[str, ...]) -> dict[str, Any]:
        """Return the start values of a component in the form of a scenario. Raises ScenarioError."""
        fmu = self._fmus[path]
        starts: dict[str, Any] = {}
        for end, value in self._values.items():
            if end.path != path:
                continue
            variable = fmu.variables[end.name]
            if not variable.is_settable:
                self._lost(
                    f"{value.place}: a value for '{end}', which takes none (causality {variable.causality})"
                )
                continue
            try:
                starts[end.name] = _start(value, variable)
            except ValueError as error:
                raise ScenarioError(f"{value.place}: the value for '{end}' does not fit: {error}") from error
        return starts


def _in_unit(value: ParameterValue, wire: Wire) -> ParameterValue:
    """Return a value in the unit at the source of a wire: what the wire does comes after."""
    numbers = value.numbers(wire.unit)
    return ParameterValue(value.type, tuple(numbers), wire.unit, value.place, suppressed=True)


def _start(value: ParameterValue, variable: Variable) -> Any:
    if value.type == "Enumeration":
        found: list[Any] = []
        for name in value.values:
            if name not in variable.items:
                raise ValueError(
                    f"'{name}' is no item of its enumeration.{did_you_mean(str(name), variable.items)}"
                )
            found.append(variable.items[str(name)])
    elif value.type == "String":
        found = list(value.values)
    else:
        found = list(value.numbers(variable.unit))
    return found if variable.row.dimensions or len(found) != 1 else found[0]
