"""Parameter values of SSV files and their mappings of SSM files, as values by name."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

from engines.fmu.ssp.structure import Binding
from engines.fmu.ssp.transformations import Linear, Transformation, compose, read_transformation
from engines.fmu.ssp.units import Unit, conversion, read_units
from engines.fmu.ssp.xml_file import Node
from schemas.errors import ScenarioError

__all__ = ["ParameterValue", "read_binding"]

_REALS = {"Real", "Float64", "Float32"}
_TEXTS = {"String", "Enumeration"}
_LONGEST_NUMBER = 80
_BOOLEANS = {"true": True, "1": True, "false": False, "0": False}


@dataclass(frozen=True)
class ParameterValue:
    """A value of a parameter set, in its own unit, and the transformation after the conversion of unit."""

    type: str
    """Local name of the type: `Real`, `Boolean`, `Enumeration`, ..."""
    values: tuple[float | int | bool | str, ...]
    unit: Unit | None
    place: str
    transformation: Transformation = field(default_factory=Linear)
    suppressed: bool = False
    """Whether the unit is not converted."""

    def through(self, step: Transformation) -> ParameterValue:
        """Return the value with a further transformation. Raises ValueError."""
        return ParameterValue(
            self.type, self.values, self.unit, self.place, compose(self.transformation, step), self.suppressed
        )

    def numbers(self, unit: Unit | None) -> list[float | int | bool]:
        """Return the numbers in `unit`. Raises ValueError for texts and for a unit of another dimension."""
        change: Transformation = Linear()
        if unit and self.unit and not self.suppressed:
            change = conversion(self.unit, unit)
        change = compose(change, self.transformation)
        if any(isinstance(value, str) for value in self.values):
            raise ValueError(f"it is a {self.type}, not a number")
        if change.is_identity:
            return [value for value in self.values if not isinstance(value, str)]
        return [change.apply(float(value)) for value in self.values]


def read_binding(
    given: Binding, owner: str, lost: Callable[[str], None]
) -> Iterator[tuple[str, ParameterValue]]:
    """Yield names and values of a parameter binding, mapped and with its prefix. Raises ScenarioError."""
    binding, document = given.node, given.document
    what = f"{binding.place}: a parameter binding of '{owner}'"
    if binding.get("type", "application/x-ssp-parameter-set") != "application/x-ssp-parameter-set":
        lost(f"{what} of type '{binding.get('type')}': only parameter sets of SSP are read")
        return
    if binding.get("sourceBase", "SSD") != "SSD":
        lost(f"{what} with parameters inside an FMU (sourceBase='{binding.get('sourceBase')}')")
        return
    parent, source = binding.find("ssd:ParameterValues"), binding.get("source")
    if source:
        root: Node | None = document.resolve(source, what).xml()
    else:
        root = parent.find("ssv:ParameterSet") if parent else None
    if root is None or root.name != "ssv:ParameterSet":
        raise ScenarioError(f"{what} holds no ParameterSet, inline or as 'source'")
    prefix = binding.get("prefix")
    values = {prefix + name: value for name, value in _read_set(root, lost)}
    mapping = binding.find("ssd:ParameterMapping")
    if mapping is None:
        yield from values.items()
        return
    source = mapping.get("source")
    table = document.resolve(source, what).xml() if source else mapping.find("ssm:ParameterMapping")
    if table is None or table.name != "ssm:ParameterMapping":
        raise ScenarioError(f"{what} has a mapping without ParameterMapping, inline or as 'source'")
    yield from _mapped(table, values, lost)


def _mapped(
    table: Node, values: Mapping[str, ParameterValue], lost: Callable[[str], None]
) -> Iterator[tuple[str, ParameterValue]]:
    targets: set[str] = set()
    for entry in table.all("ssm:MappingEntry"):
        source, target = entry.require("source"), entry.require("target")
        if target in targets:
            raise ScenarioError(f"{entry.place}: two parameters are mapped to '{target}'")
        targets.add(target)
        if source not in values:
            lost(f"{entry.place}: '{source}' is mapped to '{target}', and no parameter has that name")
            continue
        value = values[source]
        if entry.find("ssc:EnumerationMappingTransformation"):
            yield target, _mapped_names(entry, value)
            continue
        step = read_transformation(entry, {}, {})
        yield (
            target,
            ParameterValue(
                value.type,
                value.values,
                value.unit,
                entry.place,
                step,
                entry.boolean("suppressUnitConversion"),
            ),
        )


def _mapped_names(entry: Node, value: ParameterValue) -> ParameterValue:
    """Return an enumeration value with another name."""
    parent = entry.find("ssc:EnumerationMappingTransformation")
    names = (
        {one.require("source"): one.require("target") for one in parent.all("ssc:MapEntry")} if parent else {}
    )
    texts = tuple(names.get(str(one), one) for one in value.values)
    return ParameterValue(value.type, texts, value.unit, entry.place)


def _read_set(root: Node, lost: Callable[[str], None]) -> Iterator[tuple[str, ParameterValue]]:
    units = read_units(root.find("ssv:Units"))
    parameters = root.find("ssv:Parameters")
    seen: set[str] = set()
    for node in parameters.all("ssv:Parameter") if parameters else ():
        name = node.require("name")
        if name in seen:
            raise ScenarioError(f"{node.place}: parameter '{name}' has two values in the set")
        seen.add(name)
        typed = next(
            (one for one in node.children if one.name.startswith("ssv:") and one.name != "ssv:Dimension"),
            None,
        )
        if typed is None:
            raise ScenarioError(f"{node.place}: parameter '{name}' has no value")
        kind = typed.name.partition(":")[2]
        if kind == "Binary":
            lost(f"{node.place}: parameter '{name}' is binary, which has no start value here")
            continue
        unit = units.get(typed.get("unit"), Unit(typed.get("unit"))) if typed.get("unit") else None
        yield name, ParameterValue(kind, tuple(_values(typed, kind, name)), unit, node.place)


def _values(node: Node, kind: str, name: str) -> Iterator[float | int | bool | str]:
    inner = [one.text for one in node.all("ssv:Value")]
    if kind in _TEXTS:
        yield from inner or [node.require("value")]
        return
    for text in inner or node.require("value").split():
        try:
            yield _number(text, kind)
        except (ValueError, KeyError) as error:
            raise ScenarioError(f"{node.place}: '{text[:80]}' of parameter '{name}' is no {kind}") from error


def _number(text: str, kind: str) -> float | int | bool:
    if len(text) > _LONGEST_NUMBER:
        raise ValueError(f"a number of {len(text)} characters")
    if kind == "Boolean":
        return _BOOLEANS[text]
    return float(text) if kind in _REALS else int(text)
