"""modelDescription.xml of a robot, for FMI 2.0 and 3.0."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from importlib.metadata import version
from typing import Literal
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from engines.mujoco.export.fmu.robot import Robot, Variable

__all__ = ["FmiVersion", "description"]

FmiVersion = Literal["2", "3"]

_UNITS: Mapping[str, Mapping[str, str]] = {
    "rad": {"rad": "1"},
    "m": {"m": "1"},
    "rad/s": {"rad": "1", "s": "-1"},
    "m/s": {"m": "1", "s": "-1"},
    "N": {"kg": "1", "m": "1", "s": "-2"},
    "N*m": {"kg": "1", "m": "2", "s": "-2"},
    "m/s^2": {"m": "1", "s": "-2"},
    "s": {"s": "1"},
}
"""Exponents of base units (FMI 2.0.4 section 2.2.2)."""
_STOP_S = 1.0


def description(robot: Robot, fmi: FmiVersion, token: str, identifier: str) -> str:
    """Return the text of modelDescription.xml; `identifier` is the name of the library."""
    tools = ", ".join(
        f"{arm} with {getattr(one, 'instrument', None) or getattr(one, 'endoscope', '')}"
        for arm, one in robot.params.arms.items()
    )
    root = Element("fmiModelDescription", fmiVersion=f"{fmi}.0", modelName=identifier)
    root.set("guid" if fmi == "2" else "instantiationToken", token)
    root.set("description", f"da Vinci Research Kit under position servos: {tools}")
    root.set("generationTool", f"Trocar {version('trocar')}")
    root.set("generationDateAndTime", datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"))
    root.set("variableNamingConvention", "structured")
    if fmi == "2":
        root.set("numberOfEventIndicators", "0")
    _add_capabilities(root, robot, fmi, identifier)
    _add_units(root, fmi)
    categories = SubElement(root, "LogCategories")
    SubElement(categories, "Category", name="logStatusError", description="why a function fails")
    step = robot.period_ns * 1e-9
    SubElement(root, "DefaultExperiment", startTime="0", stopTime=repr(_STOP_S), stepSize=repr(step))
    _add_variables(root, robot, fmi)
    _add_structure(root, robot, fmi)
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _add_capabilities(root: Element, robot: Robot, fmi: FmiVersion, identifier: str) -> None:
    part = SubElement(root, "CoSimulation", modelIdentifier=identifier)
    word = "FMUstate" if fmi == "2" else "FMUState"
    part.set(f"canGetAndSet{word}", "true")
    part.set(f"canSerialize{word}", "true")
    part.set("canHandleVariableCommunicationStepSize", "false")
    if fmi == "3":
        part.set("fixedInternalStepSize", repr(robot.period_ns * 1e-9))


def _add_units(root: Element, fmi: FmiVersion) -> None:
    definitions = SubElement(root, "UnitDefinitions")
    for name, exponents in _UNITS.items():
        if fmi == "2" or name != "s":
            SubElement(SubElement(definitions, "Unit", name=name), "BaseUnit", dict(exponents))


def _add_variables(root: Element, robot: Robot, fmi: FmiVersion) -> None:
    variables = SubElement(root, "ModelVariables")
    for reference, variable in enumerate(robot.variables):
        number = _attributes(variable)
        common = {
            "name": variable.name,
            "valueReference": str(reference),
            "causality": variable.causality,
            "variability": "tunable" if variable.causality == "parameter" else "continuous",
            "description": variable.description,
        }
        if variable.causality == "parameter":
            common["initial"] = "exact"
        if variable.causality == "output":
            common["initial"] = "calculated"
            del number["start"]
        if fmi == "2":
            SubElement(SubElement(variables, "ScalarVariable", common), "Real", number)
        else:
            SubElement(variables, "Float64", common | number)
    if fmi == "3":
        time = {"name": "time", "valueReference": str(len(robot.variables)), "causality": "independent"}
        SubElement(variables, "Float64", time | {"variability": "continuous"})


def _attributes(variable: Variable) -> dict[str, str]:
    number = {"start": repr(variable.start)}
    if variable.unit:
        number["unit"] = variable.unit
    if variable.limits is not None:
        number["min"], number["max"] = (repr(end) for end in variable.limits)
    return number


def _add_structure(root: Element, robot: Robot, fmi: FmiVersion) -> None:
    """State that outputs depend on the state alone: an importer need not look for algebraic loops."""
    structure = SubElement(root, "ModelStructure")
    first = len(robot.variables) - len(robot.outputs)
    references = range(first, len(robot.variables))
    if fmi == "2":
        for element in ("Outputs", "InitialUnknowns"):
            listed = SubElement(structure, element)
            for reference in references:
                SubElement(listed, "Unknown", index=str(reference + 1), dependencies="")
        return
    for element in ("Output", "InitialUnknown"):
        for reference in references:
            SubElement(structure, element, valueReference=str(reference), dependencies="")
