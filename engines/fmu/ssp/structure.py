"""The structure of a system: elements, connectors, connections and parameter bindings of an SSD file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from engines.fmu.ssp.package import Document
from engines.fmu.ssp.units import Unit, read_units
from engines.fmu.ssp.xml_file import Node
from schemas.errors import ScenarioError

__all__ = [
    "FMU",
    "Binding",
    "Component",
    "Connector",
    "Description",
    "DictionaryReference",
    "Element",
    "System",
    "read_description",
]

FMU = "application/x-fmu-sharedlibrary"
_DEFINITION, _PACKAGE = "application/x-ssp-definition", "application/x-ssp-package"
"""Types of components that are a system in a file of its own."""
KINDS = (
    *("input", "output", "inout", "parameter", "calculatedParameter", "structuralParameter"),
    *("constant", "local", "unspecified"),
)
_NO_TYPES = {"ssd:ConnectorGeometry", "ssc:Dimension", "ssd:Dimension", "ssd:Clock", "ssc:Annotations"}
_DEEPEST = 20
"""Levels of systems in systems."""
_MOST_ELEMENTS = 10_000
"""Systems and components; a file may be an element many times."""

_KNOWN: Mapping[str, frozenset[str]] = {
    "ssd:SystemStructureDescription": frozenset(
        {"ssd:System", "ssd:Enumerations", "ssd:Units", "ssd:DefaultExperiment", "ssd:Annotations"}
    ),
    "ssd:System": frozenset(
        {
            *("ssd:Connectors", "ssd:ParameterBindings", "ssd:Elements", "ssd:Connections"),
            *("ssd:SignalDictionaries", "ssd:Annotations"),
        }
    ),
    "ssd:SignalDictionaryReference": frozenset({"ssd:Connectors", "ssd:Annotations"}),
    "ssd:Component": frozenset({"ssd:Connectors", "ssd:ParameterBindings", "ssd:Annotations"}),
    "ssd:Elements": frozenset({"ssd:System", "ssd:Component", "ssd:SignalDictionaryReference"}),
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


@dataclass(frozen=True)
class Binding:
    """A parameter binding, and the file from which its URIs start."""

    node: Node
    document: Document


@dataclass
class Element:
    """A system or a component: what both have."""

    name: str
    path: tuple[str, ...]
    """Names from the outermost system's child to this element; empty for the outermost system."""
    place: str
    connectors: dict[str, Connector]
    bindings: list[Binding]
    annotations: Node | None
    document: Document
    """File of the element, from which its URIs start."""

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
class DictionaryReference(Element):
    """Access to the signals of a signal dictionary."""

    dictionary: str


@dataclass
class System(Element):
    """Elements and the connections among them."""

    dictionaries: frozenset[str] = frozenset()
    """Names of the signal dictionaries."""
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
    root: System
    start_time: float
    stop_time: float | None
    annotations: list[Node]
    """Annotations of the description, its experiment and the outermost system."""
    lost: list[str]
    """Elements that are not carried over, each a sentence."""


def read_description(document: Document) -> Description:
    """Return the structure in an SSD file. Raises ScenarioError, with line, for a broken one."""
    root = document.xml()
    outer = _outermost(root)
    reader = _Reader(document, root)
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
    return Description(
        name=root.require("name"),
        root=reader.system(outer, ()),
        start_time=start,
        stop_time=stop,
        annotations=[one for one in notes if one],
        lost=reader.lost,
    )


def _outermost(root: Node) -> Node:
    if root.name != "ssd:SystemStructureDescription":
        raise ScenarioError(f"{root.place}: the root element is {root.name}, not SystemStructureDescription")
    version = root.require("version")
    if version not in {"1.0", "2.0"}:
        raise ScenarioError(f"{root.place}: version '{version}' of SSP; 1.0 and 2.0 are allowed")
    outer = root.find("ssd:System")
    if outer is None:
        raise ScenarioError(f"{root.place}: the description has no System")
    return outer


_Common = tuple[str, tuple[str, ...], str, dict[str, Connector], list[Binding], Node | None, Document]
"""The fields of `Element`."""


class _Reader:
    """Reads elements with the units and enumerations of their file."""

    def __init__(self, document: Document, root: Node, lost: list[str] | None = None) -> None:
        """Read units and enumerations of a file; what is not carried over goes to `lost`."""
        self._document = document
        self.lost: list[str] = [] if lost is None else lost
        """Elements that are not carried over, each a sentence."""
        self.lost += _lost(root)
        self._count = 0
        self.units = read_units(root.find("ssd:Units"))
        enumerations = root.find("ssd:Enumerations")
        self._items = {
            node.require("name"): {
                item.require("name"): int(item.number("value", 0)) for item in node.all("ssc:Item")
            }
            for node in (enumerations.all("ssc:Enumeration") if enumerations else ())
        }

    def system(self, node: Node, path: tuple[str, ...]) -> System:
        """Return a system with everything inside."""
        if len(path) > _DEEPEST:
            raise ScenarioError(f"{node.place}: more than {_DEEPEST} systems inside each other")
        system = System(*self._common(node, path))
        elements = node.find("ssd:Elements")
        for child in elements.children if elements else ():
            if child.name not in _KNOWN["ssd:Elements"]:
                continue
            name = child.require("name")
            if name in system.elements:
                other = system.elements[name].place
                raise ScenarioError(
                    f"{child.place}: '{name}' is the name of two elements of the system (the other: {other})"
                )
            self._count += 1
            if self._count > _MOST_ELEMENTS:
                raise ScenarioError(f"{child.place}: more than {_MOST_ELEMENTS} systems and components")
            system.elements[name] = self._element(child, (*path, name))
        dictionaries = node.find("ssd:SignalDictionaries")
        if dictionaries is not None:
            system.dictionaries = frozenset(
                one.require("name") for one in dictionaries.all("ssd:SignalDictionary")
            )
        connections = node.find("ssd:Connections")
        system.connections = list(connections.all("ssd:Connection")) if connections else []
        return system

    def _element(self, node: Node, path: tuple[str, ...]) -> Element:
        if node.name == "ssd:System":
            return self.system(node, path)
        if node.name == "ssd:Component":
            return self._component(node, path)
        return DictionaryReference(*self._common(node, path), dictionary=node.require("dictionary"))

    def _component(self, node: Node, path: tuple[str, ...]) -> Element:
        source, type_ = node.get("source"), node.get("type", FMU)
        if source and not source.startswith("#") and type_ in {_DEFINITION, _PACKAGE}:
            return self._file_system(node, path, source, type_)
        return Component(
            *self._common(node, path),
            source=source,
            type=type_,
            implementation=node.get("implementation", "any"),
        )

    def _file_system(self, node: Node, path: tuple[str, ...], source: str, type_: str) -> System:
        """Return the system in a file that a component names, with the component's parameter bindings."""
        what = f"{node.place}: component '{node.get('name')}'"
        if type_ == _PACKAGE:
            document = self._document.open_package(source, what)
        else:
            document = self._document.resolve(source, what)
        root = document.xml()
        inner = _Reader(document, root, self.lost)
        inner._count = self._count
        system = inner.system(_outermost(root), path)
        self._count = inner._count
        system.name = node.require("name")
        system.bindings += self._bindings(node)
        return system

    def _bindings(self, node: Node) -> list[Binding]:
        parent = node.find("ssd:ParameterBindings")
        return [Binding(one, self._document) for one in parent.all("ssd:ParameterBinding")] if parent else []

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
        return (
            node.require("name"),
            path,
            node.place,
            connectors,
            self._bindings(node),
            node.find("ssd:Annotations"),
            self._document,
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
