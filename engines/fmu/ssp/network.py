"""The connections of nested systems, resolved to connections between FMUs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from engines.fmu.ssp.fmus import Fmu
from engines.fmu.ssp.structure import Component, Description, DictionaryReference, Element, System
from engines.fmu.ssp.transformations import Linear, Transformation, compose, read_transformation
from engines.fmu.ssp.units import Unit, conversion
from engines.fmu.ssp.xml_file import Node
from schemas.errors import ScenarioError, did_you_mean

__all__ = ["End", "Network", "Wire", "find_loop"]

_INTO = frozenset({"input", "parameter", "structuralParameter"})
_OUT = frozenset({"output", "local", "calculatedParameter", "constant"})


@dataclass(frozen=True)
class End:
    """A connector of an element."""

    path: tuple[str, ...]
    name: str

    def __str__(self) -> str:
        return ".".join((*self.path, self.name))


@dataclass(frozen=True)
class Wire:
    """How a connector gets its value: from an output of an FMU, or from a connector without a source."""

    source: End
    target: End
    change: Transformation
    unit: Unit | None
    """Unit at the source."""
    place: str


class Network:
    """All connections of a system, by the connector at the end."""

    def __init__(
        self,
        description: Description,
        fmus: Mapping[tuple[str, ...], Fmu],
        lost: Callable[[str], None],
    ) -> None:
        """Read the connections. Raises ScenarioError for one that is ambiguous or has no such end."""
        self._fmus = fmus
        self._elements: dict[tuple[str, ...], Element] = {}
        self._edges: dict[End, tuple[End, Node]] = {}
        for system in description.root.systems():
            self._elements[system.path] = system
            self._elements |= {one.path: one for one in system.elements.values()}
        for element in list(self._elements.values()):
            if isinstance(element, DictionaryReference):
                signals = self._elements.setdefault(
                    self._dictionary(element), replace(element, connectors={})
                )
                signals.connectors |= element.connectors
        for system in description.root.systems():
            for node in system.connections:
                self._add(system, node, lost)

    def _add(self, system: System, node: Node, lost: Callable[[str], None]) -> None:
        start, end = (self._end(system, node, side) for side in ("start", "end"))
        text = f"{node.place}: the connection {start} -> {end}"
        for one in (start, end):
            element = self._elements[one.path]
            if isinstance(element, Component) and one.path not in self._fmus:
                lost(f"{text}: component '{element.label}' is left out")
                return
        if node.get("startIndices") or node.get("endIndices"):
            lost(f"{text}: single elements of arrays cannot be connected, only whole arrays")
            return
        source, target = self._direct(system, start, end, text)
        if target in self._edges:
            other = self._edges[target][0]
            raise ScenarioError(f"{text}: '{target}' is fed twice, by '{other}' and by '{source}'")
        self._edges[target] = (source, node)

    def _end(self, system: System, node: Node, side: str) -> End:
        name, element = node.get(f"{side}Element"), system
        if name:
            if name not in system.elements:
                hint = did_you_mean(name, system.elements)
                raise ScenarioError(f"{node.place}: system '{system.label}' has no element '{name}'.{hint}")
            element = system.elements[name]
        connector = node.require(f"{side}Connector")
        if connector not in element.connectors:
            raise ScenarioError(
                f"{node.place}: element '{element.label}' has no connector"
                f" '{connector}'.{did_you_mean(connector, element.connectors)}"
            )
        if isinstance(element, DictionaryReference):
            return End(self._dictionary(element), connector)
        return End(element.path, connector)

    def _dictionary(self, reference: DictionaryReference) -> tuple[str, ...]:
        """Return the path that stands for a signal dictionary: all references to it are one element.

        The innermost system with a dictionary of the name has it (SSP 2.0, section 5.5).
        """
        for length in range(len(reference.path) - 1, -1, -1):
            system = self._elements[reference.path[:length]]
            if isinstance(system, System) and reference.dictionary in system.dictionaries:
                return (*system.path, f"dictionary {reference.dictionary}")
        raise ScenarioError(
            f"{reference.place}: '{reference.label}' refers to the signal dictionary"
            f" '{reference.dictionary}', which no enclosing system has"
        )

    def _direct(self, system: System, start: End, end: End, text: str) -> tuple[End, End]:
        """Return source and target: the kinds of the connectors decide, not `start` and `end`."""
        gives, takes = self._gives(system, start), self._gives(system, end)
        if gives is None and takes is None:
            return start, end
        if gives is not None and gives == takes:
            how = "give a value" if gives else "take a value"
            raise ScenarioError(
                f"{text} joins two connectors that both {how}: {self._kind(start)} and {self._kind(end)}"
            )
        return (start, end) if gives or takes is False else (end, start)

    def _gives(self, system: System, end: End) -> bool | None:
        """Return whether a connector is a source inside `system`; None: the other end decides."""
        kind = self._kind(end)
        if kind not in _INTO | _OUT:
            return None
        return (kind in _INTO) if end.path == system.path else (kind in _OUT)

    def _kind(self, end: End) -> str:
        fmu = self._fmus.get(end.path)
        return (
            fmu.variables[end.name].causality if fmu else self._elements[end.path].connectors[end.name].kind
        )

    def _unit(self, end: End) -> Unit | None:
        stated = self._elements[end.path].connectors[end.name].unit
        fmu = self._fmus.get(end.path)
        return (fmu.variables[end.name].unit if fmu else None) or stated

    def _items(self, end: End) -> Mapping[str, int]:
        stated = self._elements[end.path].connectors[end.name].items
        fmu = self._fmus.get(end.path)
        return stated or (fmu.variables[end.name].items if fmu else {})

    def wires(self) -> list[Wire]:
        """Return the wire to each connector of an FMU with a connection. Raises ScenarioError."""
        return [self._trace(target) for target in self._edges if target.path in self._fmus]

    def views(self) -> list[Wire]:
        """Return the wire to each connected output of the outermost system. Raises ScenarioError."""
        return [self._trace(target) for target in self._edges if not target.path]

    def _trace(self, target: End) -> Wire:
        chain: list[tuple[End, Node]] = []
        at, seen = target, {target}
        while at in self._edges:
            source, node = self._edges[at]
            chain.insert(0, (at, node))
            at = source
            if at in seen:
                raise ScenarioError(f"{node.place}: '{at}' is connected to itself: no FMU gives the value")
            seen.add(at)
            if at.path in self._fmus:
                break
        origin, change, place = at, Linear(), chain[-1][1].place
        unit = first = self._unit(origin)
        for end, node in chain:
            there = self._unit(end)
            try:
                step = read_transformation(node, self._items(at), self._items(end))
                suppressed = node.boolean("suppressUnitConversion")
                if unit and there and not suppressed:
                    change = compose(change, conversion(unit, there))
                change = compose(change, step)
            except ValueError as error:
                raise ScenarioError(
                    f"{node.place}: the connection {at} -> {end} cannot be converted: {error}. Correct"
                    " the unit of a connector, or state suppressUnitConversion"
                ) from error
            # a value whose conversion is suppressed is in the unit of whatever comes next
            unit, at = there or (None if suppressed else unit), end
        return Wire(origin, target, change, first, place)


def find_loop(wires: Sequence[Wire]) -> list[Wire]:
    """Return the wires of a loop of elements in order; empty: there is none."""
    feeding: dict[tuple[str, ...], list[Wire]] = {}
    for wire in wires:
        feeding.setdefault(wire.target.path, []).append(wire)
    while ended := [
        path for path, into in feeding.items() if not any(w.source.path in feeding for w in into)
    ]:
        for path in ended:
            del feeding[path]
    if not feeding:
        return []
    loop: list[Wire] = []
    at = next(iter(feeding))
    while at not in [wire.target.path for wire in loop]:
        loop.insert(0, next(wire for wire in feeding[at] if wire.source.path in feeding))
        at = loop[0].source.path
    last = next(index for index, wire in enumerate(loop) if wire.target.path == at)
    return loop[: last + 1]
