"""XML of a stranger as nodes with line numbers, within limits: no document type, so no entities."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from xml.parsers import expat

from schemas.errors import ScenarioError, did_you_mean

__all__ = ["NAMESPACES", "Node", "parse_xml"]

NAMESPACES = {
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
    "ssm": "http://ssp-standard.org/SSP1/SystemStructureParameterMapping",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssb": "http://ssp-standard.org/SSP1/SystemStructureSignalDictionary",
    "oms": "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
    "osp": "http://opensimulationplatform.com/SSP/OSPAnnotations",
    "trocar": "urn:trocar:ssp",
}
"""XML namespaces by prefix. SSP 2.0 keeps the names of 1.0; oms and osp are annotations with a step size."""

_PREFIXES = {uri: prefix for prefix, uri in NAMESPACES.items()}
_LARGEST = 32 << 20
"""Bytes of a file: 100 000 connections with geometry."""
_MOST_NODES = 500_000
_DEEPEST = 100
_LONGEST = 200
"""Most letters of a value in a message."""
_NAMES = frozenset(
    {"name", "kind", "source", "target", "unit", "type", "prefix", "version", "implementation"}
    | {f"{side}{what}" for side in ("start", "end") for what in ("Element", "Connector")}
)
_LONGEST_NAME = 500
"""Most letters of the attributes `_NAMES`, which messages quote."""


@dataclass
class Node:
    """An element, with the file and line of its start."""

    name: str
    """Prefix of `NAMESPACES` and local name, such as `ssd:System`; `?:` for other namespaces."""
    attributes: dict[str, str]
    file: str
    line: int
    text: str = ""
    children: list[Node] = field(default_factory=list["Node"])

    @property
    def place(self) -> str:
        """File and line, in front of a message."""
        return f"{self.file}, line {self.line}"

    def all(self, name: str) -> Iterator[Node]:
        """Yield the children called `name`."""
        return (child for child in self.children if child.name == name)

    def find(self, *path: str) -> Node | None:
        """Return the first descendant along a path of names."""
        node: Node | None = self
        for name in path:
            node = next(node.all(name), None) if node else None
        return node

    def get(self, attribute: str, default: str = "") -> str:
        """Return an attribute."""
        return self.attributes.get(attribute, default)

    def require(self, attribute: str) -> str:
        """Return an attribute without which the element has no meaning. Raises ScenarioError."""
        if attribute not in self.attributes:
            known = did_you_mean(attribute, self.attributes)
            raise ScenarioError(f"{self.place}: {self.name} lacks the attribute '{attribute}'.{known}")
        return self.attributes[attribute]

    def number(self, attribute: str, default: float) -> float:
        """Return an attribute as a finite number. Raises ScenarioError."""
        text = self.get(attribute)
        try:
            value = float(text) if text else default
        except ValueError:
            value = float("nan")
        if value - value != 0.0:  # not finite
            raise ScenarioError(
                f"{self.place}: {attribute}='{text[:_LONGEST]}' of {self.name} is no finite number"
            )
        return value

    def boolean(self, attribute: str) -> bool:
        """Return an attribute of type xs:boolean, false by default. Raises ScenarioError."""
        text = self.get(attribute, "false")
        if text not in {"true", "false", "1", "0"}:
            raise ScenarioError(
                f"{self.place}: {attribute}='{text[:_LONGEST]}' of {self.name} is neither true nor false"
            )
        return text in {"true", "1"}


class _RefusedError(Exception):
    """The file is beyond a limit or has a document type."""


def parse_xml(data: bytes, file: str) -> Node:
    """Return the root element of a file. Raises ScenarioError, with the place in `file`."""
    if len(data) > _LARGEST:
        raise ScenarioError(f"{file} has {len(data)} bytes; at most {_LARGEST} are allowed")
    parser = expat.ParserCreate(namespace_separator=" ")
    builder = _Builder(parser, file)
    try:
        parser.Parse(data, True)
    except _RefusedError as error:
        raise ScenarioError(f"{file}, line {parser.CurrentLineNumber}: {error}") from error
    except (expat.ExpatError, ValueError, LookupError) as error:  # LookupError: an unknown encoding
        raise ScenarioError(f"{file} is not XML in UTF-8: {error}") from error
    if builder.root is None:
        raise ScenarioError(f"{file} has no root element")
    return builder.root


class _Builder:
    """Builds nodes from the parser's events."""

    def __init__(self, parser: expat.XMLParserType, file: str) -> None:
        self.root: Node | None = None
        self._open: list[Node] = []
        self._count = 0
        self._parser, self._file = parser, file
        parser.buffer_text = True
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = self._characters
        parser.StartDoctypeDeclHandler = self._refuse_document_type

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        self._count += 1
        if self._count > _MOST_NODES or len(self._open) >= _DEEPEST:
            raise _RefusedError(f"more than {_MOST_NODES} elements, or deeper than {_DEEPEST} levels")
        if too_long := [key for key in _NAMES & attributes.keys() if len(attributes[key]) > _LONGEST_NAME]:
            raise _RefusedError(f"'{too_long[0]}' has more than {_LONGEST_NAME} letters")
        uri, _, local = name.rpartition(" ")
        prefixed = f"{_PREFIXES.get(uri, '?')}:{local}"
        node = Node(prefixed, attributes, self._file, self._parser.CurrentLineNumber)
        if self._open:
            self._open[-1].children.append(node)
        else:
            self.root = node
        self._open.append(node)

    def _end(self, _: str) -> None:
        self._open.pop()

    def _characters(self, text: str) -> None:
        self._open[-1].text += text

    def _refuse_document_type(self, *_: object) -> None:
        raise _RefusedError("a document type (<!DOCTYPE>), which SSP does not use, is not read")
