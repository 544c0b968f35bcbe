"""The structure of a system: elements, connectors, connections and parameter bindings of an SSD file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from engines.fmu.ssp.units import Unit, read_units
from engines.fmu.ssp.xml_file import Node
from schemas.errors import ScenarioError

__all__ = ["Component", "Connector", "Description", "Element", "System", "read_description"]

KINDS = (
    *("input", "output", "inout", "parameter", "calculatedParameter", "structuralParameter"),
    *("constant", "local", "unspecified"),
)
_NO_TYPES = {"ssd:ConnectorGeometry", "ssc:Dimension", "ssd:Dimension", "ssd:Clock", "ssc:Annotations"}
_DEEPEST = 20
"""Levels of systems in systems."""

_KNOWN: Mapping[str, frozenset[str]] = {
    "ssd:SystemStructureDescription": frozenset(
        {"ssd:System", "ssd:Enumerations", "ssd:Units", "ssd:DefaultExperiment", "ssd:Annotations"}
    ),
    "ssd:System": frozenset(
        {"ssd:Connectors", "ssd:ParameterBindings", "ssd:Elements", "ssd:Connections", "ssd:Annotations"}
    ),
    "ssd:Component": frozenset({"ssd:Connectors", "ssd:ParameterBindings", "ssd:Annotations"}),
    "ssd:Elements": frozenset({"ssd:System", "ssd:Component"}),
    "ssd:Connectors": frozenset({"ssd:Connector"}),
    "ssd:Connections": frozenset({"ssd:Connection"}),
    "ssd:ParameterBindings": frozenset({"ssd:ParameterBinding"}),
    "ssd:ParameterBinding": frozenset({"ssd:ParameterValues", "ssd:ParameterMapping"}),
    "ssd:Connection": frozenset(
        {
            "ssc:LinearTransformation",
            "ssc:BooleanMappingTransformation",
            "ssc:IntegerMappingTransformation",
            "ssc:EnumerationMappingTransformation",
            "ssd:Annotations",
        }
    ),
    "ssd:DefaultExperiment": frozenset({"ssd:Annotations"}),
}
"""Children that are carried over, by element."""

_REASONS: Mapping[str, str] = {
    "ElementGeometry": "drawing",
    "ConnectorGeometry": "drawing",
    "ConnectionGeometry": "drawing",
    "SystemGeometry": "drawing",
    "GraphicalElements": "drawing",
    "MetaData": "meta data",
    "Signature": "signature",
    "SignalDictionaries": "signal dictionaries are not supported: connect the elements to one another",
    "SignalDictionaryReference": "signal dictionaries are not supported: connect the elements to one another",
}


@dataclass(frozen=True)
class Connector:
    """An input, output or parameter of an element."""

    name: str
    kind: str
    unit: Unit | None
    """None: the unit is not stated."""
    items: Mapping[str, int]
    """Values of an enumeration by name; empty for other types."""
    place: str


@dataclass
class Element:
    """A system or a component: what both have."""

    name: str
    path: tuple[str, ...]
    """Names from the outermost system's child to this element; empty for the outermost system."""
    place: str
    connectors: dict[str, Connector]
    bindings: list[Node]
    annotations: Node | None

    @property
    def label(self) -> str:
        """Dotted path for messages."""
        return ".".join(self.path) or self.name


@dataclass
class Component(Element):
    """An FMU, or anything else that is no system."""

    source: str
    type: str
    implementation: str


@dataclass
class System(Element):
    """Elements and the connections among them."""

    elements: dict[str, Element] = field(default_factory=dict[str, Element])
    connections: list[Node] = field(default_factory=list[Node])

    def components(self) -> Iterator[Component]:
        """Yield all components, at any depth, in the order of the file."""
        for element in self.elements.values():
            if isinstance(element, System):
                yield from element.components()
            elif isinstance(element, Component):
                yield element

    def systems(self) -> Iterator[System]:
        """Yield this system and all systems inside, the outer before the inner."""
        yield self
        for element in self.elements.values():
            if isinstance(element, System):
                yield from element.systems()


@dataclass
class Description:
    """A description of a system."""

    name: str
    version: str
    root: System
    units: Mapping[str, Unit]
    start_time: float
    stop_time: float | None
    annotations: list[Node]
    """Annotations of the description, its experiment and the outermost system."""
    lost: list[str]
    """Elements that are not carried over, each a sentence."""


def read_description(root: Node) -> Description:
    """Return the structure in an SSD file. Raises ScenarioError, with line, for a broken one."""
    if root.name != "ssd:SystemStructureDescription":
        raise ScenarioError(f"{root.place}: the root element is {root.name}, not SystemStructureDescription")
    version = root.require("version")
    if version not in {"1.0", "2.0"}:
        raise ScenarioError(f"{root.place}: version '{version}' of SSP; 1.0 and 2.0 are allowed")
    reader = _Reader(root)
    outer = root.find("ssd:System")
    if outer is None:
        raise ScenarioError(f"{root.place}: the description has no System")
    experiment = root.find("ssd:DefaultExperiment")
    notes = [root.find("ssd:Annotations"), outer.find("ssd:Annotations")]
    start, stop = 0.0, None
    if experiment is not None:
        notes.append(experiment.find("ssd:Annotations"))
        start = experiment.number("startTime", 0.0)
        if experiment.get("stopTime"):
            stop = experiment.number("stopTime", 0.0)
            if stop <= start:
                raise ScenarioError(f"{experiment.place}: stopTime {stop:g} is not after startTime {start:g}")
    system = reader.system(outer, ())
    lost = [*reader.lost, *_lost(root)]
    return Description(
        root.require("name"), version, system, reader.units, start, stop, [one for one in notes if one], lost
    )


_Common = tuple[str, tuple[str, ...], str, dict[str, Connector], list[Node], Node | None]
"""The fields of `Element`."""


class _Reader:
    """Reads elements with the units and enumerations of their file."""

    def __init__(self, root: Node) -> None:
        self.units = read_units(root.find("ssd:Units"))
        enumerations = root.find("ssd:Enumerations")
        self._items = {
            node.require("name"): {
                item.require("name"): int(item.number("value", 0)) for item in node.all("ssc:Item")
            }
            for node in (enumerations.all("ssc:Enumeration") if enumerations else ())
        }
        self.lost: list[str] = []

    def system(self, node: Node, path: tuple[str, ...]) -> System:
        """Return a system with everything inside."""
        if len(path) > _DEEPEST:
            raise ScenarioError(f"{node.place}: more than {_DEEPEST} systems inside each other")
        system = System(*self._common(node, path))
        elements = node.find("ssd:Elements")
        for child in elements.children if elements else ():
            if child.name not in {"ssd:System", "ssd:Component"}:
                continue
            name = child.require("name")
            if name in system.elements:
                other = system.elements[name].place
                raise ScenarioError(
                    f"{child.place}: '{name}' is the name of two elements of the system (the other: {other})"
                )
            inside = (*path, name)
            read = self.system if child.name == "ssd:System" else self._component
            system.elements[name] = read(child, inside)
        connections = node.find("ssd:Connections")
        system.connections = list(connections.all("ssd:Connection")) if connections else []
        return system

    def _component(self, node: Node, path: tuple[str, ...]) -> Component:
        return Component(
            *self._common(node, path),
            source=node.get("source"),
            type=node.get("type", "application/x-fmu-sharedlibrary"),
            implementation=node.get("implementation", "any"),
        )

    def _common(self, node: Node, path: tuple[str, ...]) -> _Common:
        connectors: dict[str, Connector] = {}
        parent = node.find("ssd:Connectors")
        for child in parent.all("ssd:Connector") if parent else ():
            connector = self._connector(child)
            if connector.name in connectors:
                raise ScenarioError(
                    f"{child.place}: '{connector.name}' is the name of two connectors of '{node.get('name')}'"
                    f" (the other: {connectors[connector.name].place})"
                )
            connectors[connector.name] = connector
        bindings = node.find("ssd:ParameterBindings")
        return (
            node.require("name"),
            path,
            node.place,
            connectors,
            list(bindings.all("ssd:ParameterBinding")) if bindings else [],
            node.find("ssd:Annotations"),
        )

    def _connector(self, node: Node) -> Connector:
        name, kind = node.require("name"), node.require("kind")
        if kind not in KINDS:
            raise ScenarioError(
                f"{node.place}: connector '{name}' is of kind '{kind}', none of {', '.join(KINDS)}"
            )
        unit, items = None, dict[str, int]()
        for child in node.children:
            if not child.name.startswith("ssc:") or child.name in _NO_TYPES:
                continue
            if text := child.get("unit"):
                unit = self.units.get(text, Unit(text))
            if child.name == "ssc:Enumeration":
                items = self._items.get(child.get("name"), {})
        if any(child.name == "ssd:Clock" for child in node.children):
            self.lost.append(f"{node.place}: the clock of connector '{name}': the FMU's own clocks hold")
        return Connector(name, kind, unit, items, node.place)


def _lost(node: Node, owner: str = "") -> Iterator[str]:
    """Yield a sentence for each element below `node` that is not carried over."""
    known = _KNOWN.get(node.name)
    if known is None:
        return
    owner = node.get("name") or owner
    for child in node.children:
        if child.name in known:
            yield from _lost(child, owner)
            continue
        local = child.name.partition(":")[2]
        what = f"{child.place}: {child.name} of '{owner}'"
        reason = _REASONS.get(local) if child.name.startswith(("ssd:", "ssc:")) else None
        yield f"{what}: {reason}" if reason else f"{what} is no element that SSP has here"
