"""A scenario of FMUs as a system of SSP: 1.0 where all FMUs are of FMI 2.0, else 2.0."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from engines.fmu.archive import opened_archive
from engines.fmu.conversions import InputConversion
from engines.fmu.description import Description, describe
from engines.fmu.engine import FmuParams
from engines.fmu.model import read_model
from engines.fmu.ssp.fmus import MODEL_EXCHANGE, RESOURCES
from engines.fmu.ssp.package import DESCRIPTION
from engines.fmu.ssp.settings import ANNOTATION, COMPONENT_KEYS, SCENARIO_KEYS, SETTINGS, json_text
from engines.fmu.ssp.xml_file import NAMESPACES
from schemas.errors import ScenarioError

if TYPE_CHECKING:
    from fmpy.model_description import ModelVariable

__all__ = ["Link", "export_system"]

_FMI2 = 2
_DATE = (1980, 1, 1, 0, 0, 0)
"""Date of all entries: equal scenarios make equal files."""


@dataclass(frozen=True)
class Link:
    """A connection between ports of two participants."""

    source: str
    source_port: str
    target: str
    target_port: str


@dataclass(frozen=True)
class _Exported:
    """An FMU, ready to write."""

    description: Description
    rows: Mapping[str, ModelVariable]
    params: FmuParams
    spec: Mapping[str, Any]
    file: str
    """Name in the archive."""
    implementation: str


def export_system(
    tree: Mapping[str, Any],
    params: Mapping[str, FmuParams],
    links: Sequence[Link],
    stop_time_s: float | None,
    file: Path,
) -> list[str]:
    """Write the scenario in `tree` to `file`; return what a system cannot state, each a sentence.

    Raises ScenarioError.
    """
    fmus = dict(_read(tree, params))
    version = "1.0" if all(one.description.major == _FMI2 for one in fmus.values()) else "2.0"
    root = _write(tree, fmus, links, stop_time_s, version)
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    try:
        with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr(_entry(DESCRIPTION), text)
            for name, path in {one.file: one.params.path for one in fmus.values()}.items():
                archive.writestr(_entry(name), _read_fmu(path))
    except OSError as error:
        raise ScenarioError(f"'{file}' cannot be written: {error}") from error
    return [
        f"'{key}' of participant '{name}' is no part of a system"
        for name, one in fmus.items()
        for key in one.spec
        if key not in {"kind", "path", "start", "inputs", "solver", *COMPONENT_KEYS}
    ] + [
        f"'{key}' is no part of a system"
        for key in tree
        if key not in {"name", "participants", "connections", "scene", "bonds", *SCENARIO_KEYS}
    ]


def _read_fmu(path: Path) -> bytes:
    with opened_archive(path) as (stream, _):
        return stream.read()


def _entry(name: str) -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo(name, _DATE)
    entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
    return entry


def _read(tree: Mapping[str, Any], params: Mapping[str, FmuParams]) -> Iterator[tuple[str, _Exported]]:
    files: dict[Path, str] = {}
    for name, one in params.items():
        if one.path not in files:
            files[one.path] = _unique_file(one.path, set(files.values()))
        model, _, _ = read_model(one.path, strict=one.strict)
        yield (
            name,
            _Exported(
                describe(one.path, one.start, strict=one.strict, solver=one.solver),
                {row.name: row for row in model.modelVariables},
                one,
                tree["participants"][name],
                files[one.path],
                MODEL_EXCHANGE if one.solver or model.coSimulation is None else "CoSimulation",
            ),
        )


def _unique_file(path: Path, taken: set[str]) -> str:
    number, name = 1, f"{RESOURCES}/{path.stem}.fmu"
    while name in taken:
        number += 1
        name = f"{RESOURCES}/{path.stem}_{number}.fmu"
    return name


def _write(
    tree: Mapping[str, Any],
    fmus: Mapping[str, _Exported],
    links: Sequence[Link],
    stop_time_s: float | None,
    version: str,
) -> Element:
    for prefix in ("ssd", "ssv", "ssc", "trocar"):
        ElementTree.register_namespace(prefix, NAMESPACES[prefix])
    root = Element(_tag("ssd:SystemStructureDescription"), version=version, name=tree["name"])
    system = _add(root, "ssd:System", name=tree["name"])
    elements = _add(system, "ssd:Elements")
    for name, one in fmus.items():
        _component(elements, name, one, version)
    if links:
        connections = _add(system, "ssd:Connections")
        for link in links:
            _connection(connections, link, fmus)
    times = {"startTime": "0.0"} | ({} if stop_time_s is None else {"stopTime": repr(stop_time_s)})
    _add(root, "ssd:DefaultExperiment", **times)
    _settings(root, {key: tree[key] for key in SCENARIO_KEYS if key in tree})
    return root


def _component(parent: Element, name: str, one: _Exported, version: str) -> None:
    component = _add(
        parent,
        "ssd:Component",
        name=name,
        type="application/x-fmu-sharedlibrary",
        source=one.file,
        implementation=one.implementation,
    )
    variables = [*one.description.inputs, *one.description.outputs]
    connectors = _add(component, "ssd:Connectors")
    for variable in variables:
        row = one.rows[variable.name]
        connector = _add(connectors, "ssd:Connector", name=variable.name, kind=str(row.causality))
        if row.type != "Enumeration":  # its items would have to be written as well; the FMU has them
            _add(connector, f"ssc:{row.type}")
        if row.dimensions and version != "1.0":
            _add(connector, "ssc:Dimension", size=str(variable.size))
    if one.description.starts:
        _parameters(component, one, version)
    _settings(component, {key: one.spec[key] for key in COMPONENT_KEYS if key in one.spec})


def _parameters(component: Element, one: _Exported, version: str) -> None:
    binding = _add(_add(component, "ssd:ParameterBindings"), "ssd:ParameterBinding")
    values = _add(binding, "ssd:ParameterValues")
    parameters = _add(_add(values, "ssv:ParameterSet", version=version, name="start"), "ssv:Parameters")
    for start in one.description.starts:
        parameter, row = _add(parameters, "ssv:Parameter", name=start.name), one.rows[start.name]
        if isinstance(start.value, bytes):
            _add(parameter, "ssv:String", value=start.value.decode())
            continue
        numbers = start.value.tolist()
        kind, texts = row.type, [_number_text(number) for number in numbers]
        if row.type == "Boolean":
            texts = ["true" if number else "false" for number in numbers]
        elif row.type == "Enumeration":
            kind = "Integer" if version == "1.0" else "Int64"
        _add(parameter, f"ssv:{kind}", value=" ".join(texts))
        if row.dimensions:
            _add(parameter, "ssc:Dimension", size=str(len(texts)))


def _number_text(number: float | int) -> str:
    return repr(number) if isinstance(number, float) else str(number)


def _connection(parent: Element, link: Link, fmus: Mapping[str, _Exported]) -> None:
    source, target = fmus[link.source].description, fmus[link.target].description
    start = next(one for one in source.outputs if one.port == link.source_port)
    end = next(one for one in target.inputs if one.port == link.target_port)
    connection = _add(
        parent,
        "ssd:Connection",
        startElement=link.source,
        startConnector=start.name,
        endElement=link.target,
        endConnector=end.name,
    )
    conversion = fmus[link.target].params.inputs.get(end.name)
    if conversion:
        # the whole conversion is stated, so that no reader's own arithmetic changes a bit
        connection.set("suppressUnitConversion", "true")
        _transformation(connection, conversion, fmus[link.target].rows[end.name].type == "Boolean")


def _transformation(connection: Element, conversion: InputConversion, boolean: bool) -> None:
    if not conversion.table:
        factor, offset = repr(conversion.factor), repr(conversion.offset)
        _add(connection, "ssc:LinearTransformation", factor=factor, offset=offset)
        return
    boolean = boolean and {*conversion.table, *conversion.table.values()} <= {0, 1}
    table = _add(connection, f"ssc:{'Boolean' if boolean else 'Integer'}MappingTransformation")
    for source, target in conversion.table.items():
        texts = [("true" if one else "false") if boolean else str(one) for one in (source, target)]
        _add(table, "ssc:MapEntry", source=texts[0], target=texts[1])


def _settings(parent: Element, settings: Mapping[str, Any]) -> None:
    if settings:
        annotation = _add(_add(parent, "ssd:Annotations"), "ssc:Annotation", type=ANNOTATION)
        _add(annotation, SETTINGS).text = json_text(settings)


def _add(parent: Element, tag: str, /, **attributes: str) -> Element:
    return SubElement(parent, _tag(tag), attributes)


def _tag(name: str) -> str:
    prefix, _, local = name.partition(":")
    return f"{{{NAMESPACES[prefix]}}}{local}"
