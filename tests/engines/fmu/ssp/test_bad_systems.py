"""Broken and hostile systems: refused with a sentence and nothing written, or named as not carried over."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest

from engines.fmu.ssp.system_import import ImportedSystem, import_system
from schemas.errors import ScenarioError
from tests.engines.fmu.driving import BALL, SPRING, STAIR
from tests.engines.fmu.ssp.systems import (
    SYSTEMS,
    System,
    component,
    connection,
    connections,
    connector,
    description,
    elements,
    value,
    values,
    write_fmus,
    write_system,
)
from tests.engines.fmus import build

pytestmark = pytest.mark.skipif(not build.USABLE, reason=build.WHY_NOT)

F, X = connector("F", "input"), connector("x", "output")
PAIR = elements(component("one", SPRING, F + X), component("two", SPRING, F + X))
LAUGHS = '<!DOCTYPE a [<!ENTITY b "ha"><!ENTITY c "&b;&b;&b;">]>'


@pytest.fixture
def fmus(libraries: dict[str, Path], tmp_path: Path) -> Path:
    write_fmus(libraries, tmp_path)
    return tmp_path


def system(text: str, **fields: object) -> System:
    return System(text, "", **fields)  # pyright: ignore


def imported(text: str, directory: Path, **fields: object) -> ImportedSystem:
    return import_system(write_system(system(text, **fields), "bad", directory), directory / "out")


REFUSED = {
    "missing FMU": (
        elements(component("one", "absent", F)),
        "component 'one' names 'resources/absent.fmu', which 'bad.ssp' does not hold.",
    ),
    "FMU elsewhere": (
        elements(component("one", "../../etc/passwd")),
        "only files inside 'bad.ssp' are read",
    ),
    "FMU in the net": (
        elements('<ssd:Component name="one" source="https://example.org/a.fmu"/>'),
        "only files inside 'bad.ssp' are read",
    ),
    "missing SSV": (
        elements(component("one", SPRING, bindings='<ssd:ParameterBinding source="resources/a.ssv"/>')),
        "a parameter binding of 'one' names 'resources/a.ssv', which 'bad.ssp' does not hold",
    ),
    "no such variable": (
        elements(component("one", SPRING, connector("G", "input"))),
        "connector 'G' of component 'one' is no variable of the FMU 'mass_spring_damper.fmu'. Known: F,",
    ),
    "another kind": (
        elements(component("one", SPRING, connector("F", "output"))),
        "connector 'F' of component 'one' is of kind 'output', the FMU's variable of causality 'input'",
    ),
    "no such kind": (
        elements(component("one", SPRING, connector("F", "inward"))),
        "connector 'F' is of kind 'inward', none of input, output",
    ),
    "unit of a connector": (
        elements(component("one", SPRING, connector("x", "output", unit="mm"))),
        "connector 'x' of component 'one' is in 'mm', the FMU's variable in 'm'",
    ),
    "units of a connection": (
        PAIR + connections(connection("one.x", "two.F")),
        "the connection one.x -> two.F cannot be converted: 'm' and 'N' are units of different dimension",
    ),
    "unit of a value": (
        elements(
            component(
                "one",
                SPRING,
                bindings=values(
                    '<ssv:Parameter name="m"><ssv:Real value="1" unit="furlong"/></ssv:Parameter>'
                ),
            )
        ),
        "the value for 'one.m' does not fit: 'furlong' is not converted to 'kg', as the files define only kg",
    ),
    "no number": (
        elements(component("one", SPRING, bindings=values(value("m", "Real", "heavy")))),
        "'heavy' of parameter 'm' is no Real",
    ),
    "no item": (
        elements(component("one", SPRING, bindings=values(value("stage", "Enumeration", "lazy")))),
        "'lazy' is no item of its enumeration. Known: busy, idle",
    ),
    "two elements of a name": (
        elements(component("one", SPRING), component("one", SPRING)),
        "'one' is the name of two elements of the system",
    ),
    "two connectors of a name": (
        elements(component("one", SPRING, F + F)),
        "'F' is the name of two connectors of 'one'",
    ),
    "two values of a name": (
        elements(
            component("one", SPRING, bindings=values(value("m", "Real", "1") + value("m", "Real", "2")))
        ),
        "parameter 'm' has two values in the set",
    ),
    "fed twice": (
        PAIR
        + connections(
            connection("one.x", "two.F", attributes='suppressUnitConversion="true"'),
            connection("two.x", "two.F", attributes='suppressUnitConversion="true"'),
        ),
        "'two.F' is fed twice, by 'one.x' and by 'two.x'",
    ),
    "two outputs": (
        PAIR + connections(connection("one.x", "two.x")),
        "joins two connectors that both give a value: output and output",
    ),
    "no such element": (
        PAIR + connections(connection("three.x", "two.F")),
        "system 'root' has no element 'three'. Known: one, two",
    ),
    "no such connector": (
        PAIR + connections(connection("one.v", "two.F")),
        "element 'one' has no connector 'v'. Known: F, x",
    ),
    "circle of systems": (
        elements(
            component("one", SPRING, F),
            '<ssd:System name="in"><ssd:Connectors>',
            connector("a", "input") + connector("b", "output"),
            "</ssd:Connectors>",
            connections(connection(".a", ".b")),
            "</ssd:System>",
        )
        + connections(connection("in.b", "in.a"), connection("in.b", "one.F")),
        "is connected to itself: no FMU gives the value",
    ),
    "factor of 0": (
        PAIR
        + connections(
            connection(
                "one.x",
                "two.F",
                '<ssc:LinearTransformation factor="0"/>',
                'suppressUnitConversion="true"',
            )
        ),
        "a factor of 0 makes 'two.F' constant",
    ),
    "factor of NaN": (
        PAIR + connections(connection("one.x", "two.F", '<ssc:LinearTransformation factor="nan"/>')),
        "factor='nan' of ssc:LinearTransformation is no finite number",
    ),
    "no signal dictionary": (
        elements(component("one", SPRING), '<ssd:SignalDictionaryReference name="bus" dictionary="can"/>'),
        "'bus' refers to the signal dictionary 'can', which no enclosing system has",
    ),
    "nothing to run": (elements('<ssd:System name="in"/>'), "has no component that is an FMU"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_refused_system_leaves_nothing(name: str, fmus: Path) -> None:
    text, expected = REFUSED[name]
    with pytest.raises(ScenarioError) as caught:
        imported(text, fmus)
    assert expected in str(caught.value)
    assert not (fmus / "out").exists()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("<a/>", "the root element is ?:a, not SystemStructureDescription"),
        (LAUGHS + "<a/>", "a document type (<!DOCTYPE>), which SSP does not use"),
        ("<a", "is not XML in UTF-8"),
        ("", "is not XML in UTF-8"),
        ("<a>" * 200 + "</a>" * 200, "deeper than 100 levels"),
    ],
)
def test_xml_that_is_no_description(text: str, expected: str, fmus: Path) -> None:
    path = write_system(system(""), "bad", fmus, text)
    with pytest.raises(ScenarioError) as caught:
        import_system(path, fmus / "out")
    assert expected in str(caught.value)


def test_a_version_of_the_future(fmus: Path) -> None:
    text = description(SYSTEMS["plain"], "bad").replace(
        'version="1.0" name="bad"', 'version="3.0" name="bad"'
    )
    with pytest.raises(ScenarioError, match=r"version '3.0' of SSP; 1.0 and 2.0 are allowed"):
        import_system(write_system(SYSTEMS["plain"], "bad", fmus, text), fmus / "out")


@pytest.mark.parametrize("name", ["../evil.fmu", "/evil.fmu", "resources/../../evil"])
def test_an_archive_that_leaves_its_directory(name: str, fmus: Path) -> None:
    path = write_system(SYSTEMS["plain"], "bad", fmus)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr(name, "x")
    with pytest.raises(ScenarioError, match="is refused: its archive holds"):
        import_system(path, fmus / "out")
    assert not (fmus / "out").exists()


def test_a_file_that_is_no_archive(fmus: Path) -> None:
    (fmus / "bad.ssp").write_text("no")
    with pytest.raises(ScenarioError, match="is no system of SSP, which is a ZIP archive"):
        import_system(fmus / "bad.ssp", fmus / "out")
    with pytest.raises(ScenarioError, match="does not exist"):
        import_system(fmus / "absent.ssp", fmus / "out")
    with zipfile.ZipFile(fmus / "bad.ssp", "w") as archive:
        archive.writestr("Structure.ssd", "")
    with pytest.raises(ScenarioError, match=r"has no file 'SystemStructure.ssd'.*Did you mean"):
        import_system(fmus / "bad.ssp", fmus / "out")


def test_a_directory_in_use_is_left_alone(fmus: Path) -> None:
    path = write_system(SYSTEMS["plain"], "bad", fmus)
    with pytest.raises(ScenarioError, match="exists and is not empty"):
        import_system(path, fmus / "resources")
    assert (fmus / "resources" / f"{STAIR}.fmu").is_file()


def test_what_is_not_carried_over_is_named(fmus: Path) -> None:
    text = (
        "<ssd:Connectors>" + connector("free", "input") + connector("seen", "output") + "</ssd:Connectors>"
    ) + elements(
        component("one", SPRING, F + X, values(value("steps", "Integer", "1"))),
        component("two", SPRING, F + connector("note", "output", "String")),
        component("ball", BALL, connector("y", "output") + connector("u", "input")),
        '<ssd:Component name="later"><ssd:Connectors>' + X + "</ssd:Connectors></ssd:Component>",
        '<ssd:Component name="model" type="text/x-modelica" source="resources/a.mo"/>',
        "<ssd:Valve/>",
    )
    text += connections(
        connection(".free", "one.F"),
        connection("one.x", ".seen"),
        connection("later.x", "two.F"),
        connection("ball.y", "ball.u", attributes='startIndices="1" endIndices="2"'),
    )
    text += '<ssd:SystemGeometry x1="0" y1="0" x2="1" y2="1"/>'
    system_ = imported(text, fmus, fmus=(SPRING, BALL))
    lost = "\n".join(system_.lost)
    for expected in (
        "ssd:SystemGeometry of 'root': drawing",
        "ssd:Valve of 'root' is no element that SSP has here",
        "component 'later' has no source: it is a place without an implementation",
        "component 'model' is of type 'text/x-modelica'; FMUs",
        "the connection later.x -> two.F: component 'later' is left out",
        "the connection ball.y -> ball.u: single elements of arrays cannot be connected",
        "the connection free -> one.F: 'free' of the system has no source and no value",
        "output 'seen' of the system: read 'one.x'",
        "a value for 'one.steps', which takes none (causality output)",
    ):
        assert expected in lost, lost
    written = system_.file.read_text()
    assert all(f"# not carried over: {line[:200]}" in written for line in system_.lost)


def test_a_loop_is_named(fmus: Path) -> None:
    system_ = import_system(write_system(SYSTEMS["loop"], "loop", fmus), fmus / "out")
    assert any(
        "connections form a loop" in note and "one.x -> two.F" in note and "two.x -> one.F" in note
        for note in system_.notes
    )
