"""Ten systems of the test FMUs in SSP's files, each with the scenario that it means, written by hand."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from tests.engines.fmu.driving import BALL, SPRING, STAIR
from tests.engines.fmus import build

HEAD = """\
<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription version="{version}" name="{name}"
    xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
    xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"
    xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
    xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping">
"""
TAIL = """\
  <ssd:Units>
    <ssc:Unit name="m"><ssc:BaseUnit m="1"/></ssc:Unit>
    <ssc:Unit name="mm"><ssc:BaseUnit m="1" factor="0.001"/></ssc:Unit>
    <ssc:Unit name="N"><ssc:BaseUnit kg="1" m="1" s="-2"/></ssc:Unit>
  </ssd:Units>
  <ssd:DefaultExperiment startTime="0" stopTime="0.5">
    <ssd:Annotations>
      <ssc:Annotation type="com.opensimulationplatform">
        <osp:Algorithm xmlns:osp="http://opensimulationplatform.com/SSP/OSPAnnotations">
          <osp:FixedStepAlgorithm baseStepSize="0.01"/>
        </osp:Algorithm>
      </ssc:Annotation>
    </ssd:Annotations>
  </ssd:DefaultExperiment>
</ssd:SystemStructureDescription>
"""
NAMESPACES = (
    'xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"'
    ' xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"'
    ' xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping"'
)
MEANT = """\
name: {name}
step: 10 ms
duration: 500 ms
algorithm: jacobi
"""


@dataclass(frozen=True)
class System:
    """A system: the text inside `ssd:System`, further files, and the scenario it means."""

    text: str
    meant: str
    """Participants and connections."""
    files: Mapping[str, str] = field(default_factory=dict[str, str])
    version: str = "1.0"
    fmus: tuple[str, ...] = (SPRING,)


def connector(name: str, kind: str, type_: str = "Real", unit: str = "") -> str:
    stated = f' unit="{unit}"' if unit else ""
    return f'<ssd:Connector name="{name}" kind="{kind}"><ssc:{type_}{stated}/></ssd:Connector>'


def component(name: str, fmu: str, connectors: str = "", bindings: str = "") -> str:
    inside = f"<ssd:Connectors>{connectors}</ssd:Connectors>" if connectors else ""
    if bindings:
        inside += f"<ssd:ParameterBindings>{bindings}</ssd:ParameterBindings>"
    return f'<ssd:Component name="{name}" source="resources/{fmu}.fmu">{inside}</ssd:Component>\n'


def connection(start: str, end: str, inside: str = "", attributes: str = "") -> str:
    """Return a connection between `element.connector` or `.connector` of the system."""
    sides: list[str] = []
    for side, text in (("start", start), ("end", end)):
        element, _, name = text.partition(".")
        sides += [f'{side}Element="{element}"'] if element else []
        sides.append(f'{side}Connector="{name}"')
    return f"<ssd:Connection {' '.join(sides)} {attributes}>{inside}</ssd:Connection>\n"


def elements(*parts: str) -> str:
    return f"<ssd:Elements>{''.join(parts)}</ssd:Elements>"


def connections(*parts: str) -> str:
    return f"<ssd:Connections>{''.join(parts)}</ssd:Connections>"


def values(inside: str, attributes: str = "", mapping: str = "") -> str:
    """Return an inline parameter binding."""
    return (
        f"<ssd:ParameterBinding {attributes}><ssd:ParameterValues>"
        f'<ssv:ParameterSet version="1.0" name="set"><ssv:Parameters>{inside}</ssv:Parameters>'
        f"</ssv:ParameterSet></ssd:ParameterValues>{mapping}</ssd:ParameterBinding>"
    )


def value(name: str, type_: str, text: str) -> str:
    return f'<ssv:Parameter name="{name}"><ssv:{type_} value="{text}"/></ssv:Parameter>'


F, X = connector("F", "input"), connector("x", "output")
UNLIKE = 'suppressUnitConversion="true"'
SPRING_OF = "kind: fmu, path: resources/mass_spring_damper.fmu"

SYSTEMS = {
    "plain": System(
        elements(
            component("stair", STAIR, connector("counter", "output", "Integer")),
            component("spring", SPRING, F),
        )
        + connections(connection("stair.counter", "spring.F")),
        f"""\
participants:
  stair: {{kind: fmu, path: resources/stair.fmu}}
  spring: {{{SPRING_OF}}}
connections: [stair.counter -> spring.F]
""",
        fmus=(STAIR, SPRING),
    ),
    "inline": System(
        elements(
            component(
                "spring",
                SPRING,
                bindings=values(value("F", "Real", "1.5") + value("c", "Real", "20"))
                + values(
                    value("c", "Real", "30")
                    + value("locked", "Boolean", "true")
                    + value("stage", "Enumeration", "busy")
                    + value("nowhere", "Real", "1")
                ),
            )
        ),
        f"""\
participants:
  spring: {{{SPRING_OF}, start: {{F: 1.5, c: 30, locked: true, stage: 2}}}}
""",
    ),
    "mapped": System(
        elements(
            component(
                "spring",
                SPRING,
                bindings='<ssd:ParameterBinding source="resources/set.ssv">'
                '<ssd:ParameterMapping source="resources/map.ssm"/></ssd:ParameterBinding>',
            )
        ),
        f"participants: {{spring: {{{SPRING_OF}, start: {{m: 0.5, x: 0.05, F: 6}}}}}}\n",
        files={
            "resources/set.ssv": f"""\
<ssv:ParameterSet version="1.0" name="set" {NAMESPACES}>
  <ssv:Parameters>
    <ssv:Parameter name="mass"><ssv:Real value="500" unit="g"/></ssv:Parameter>
    <ssv:Parameter name="place"><ssv:Real value="50" unit="mm"/></ssv:Parameter>
    <ssv:Parameter name="push"><ssv:Real value="2" unit="N"/></ssv:Parameter>
    <ssv:Parameter name="c"><ssv:Real value="99"/></ssv:Parameter>
  </ssv:Parameters>
  <ssv:Units>
    <ssc:Unit name="g"><ssc:BaseUnit kg="1" factor="0.001"/></ssc:Unit>
    <ssc:Unit name="mm"><ssc:BaseUnit m="1" factor="0.001"/></ssc:Unit>
    <ssc:Unit name="N"><ssc:BaseUnit kg="1" m="1" s="-2"/></ssc:Unit>
  </ssv:Units>
</ssv:ParameterSet>
""",
            "resources/map.ssm": f"""\
<ssm:ParameterMapping version="1.0" {NAMESPACES}>
  <ssm:MappingEntry source="mass" target="m"/>
  <ssm:MappingEntry source="place" target="x"/>
  <ssm:MappingEntry source="push" target="F">
    <ssc:LinearTransformation factor="2.5" offset="1"/>
  </ssm:MappingEntry>
</ssm:ParameterMapping>
""",
        },
    ),
    "nested": System(
        "<ssd:Connectors>"
        + connector("load", "input")
        + connector("stiffness", "parameter")
        + connector("place", "output")
        + "</ssd:Connectors><ssd:ParameterBindings>"
        + values(
            value("inner.two.d", "Real", "0.5")
            + value("load", "Real", "3")
            + value("stiffness", "Real", "40")
        )
        + "</ssd:ParameterBindings>"
        + elements(
            '<ssd:System name="inner"><ssd:Connectors>',
            connector("force", "input"),
            connector("c", "parameter"),
            connector("out", "output", unit="mm"),
            "</ssd:Connectors><ssd:ParameterBindings>",
            values(value("two.d", "Real", "9")),
            "</ssd:ParameterBindings>",
            elements(
                component("one", SPRING, F + X + connector("c", "parameter")), component("two", SPRING, F + X)
            ),
            connections(
                connection(".force", "one.F"),
                connection(".c", "one.c"),
                connection("two.F", "one.x", '<ssc:LinearTransformation factor="10"/>', UNLIKE),
                connection("two.x", ".out"),
            ),
            "</ssd:System>",
        )
        + connections(
            connection(".load", "inner.force"),
            connection(".stiffness", "inner.c"),
            connection("inner.out", ".place"),
        ),
        f"""\
participants:
  inner_one: {{{SPRING_OF}, start: {{F: 3, c: 40}}}}
  inner_two: {{{SPRING_OF}, start: {{d: 0.5}}, inputs: {{F: {{unit: m, factor: 10}}}}}}
connections: [inner_one.x -> inner_two.F]
""",
    ),
    "units": System(
        elements(
            component(
                "spring", SPRING, connector("x", "output", unit="m"), values(value("x", "Real", "0.1"))
            ),
            component("scale", "in_millimetres", F),
        )
        + connections(connection("spring.x", "scale.F")),
        f"""\
participants:
  spring: {{{SPRING_OF}, start: {{x: 0.1}}}}
  scale:
    kind: fmu
    path: resources/in_millimetres.fmu
    inputs: {{F: {{unit: m, factor: 1000}}}}
connections: [spring.x -> scale.F]
""",
        fmus=(SPRING, "in_millimetres"),
    ),
    "linear": System(
        elements(
            component("one", SPRING, X, values(value("x", "Real", "0.2"))), component("two", SPRING, F + X)
        )
        + connections(
            connection("one.x", "two.F", '<ssc:LinearTransformation factor="-3" offset="0.25"/>', UNLIKE)
        ),
        f"""\
participants:
  one: {{{SPRING_OF}, start: {{x: 0.2}}}}
  two: {{{SPRING_OF}, inputs: {{F: {{unit: m, factor: -3, offset: 0.25}}}}}}
connections: [one.x -> two.F]
""",
    ),
    "tables": System(
        elements(
            component("stair", STAIR, connector("counter", "output", "Integer")),
            component("ball", BALL, connector("seen_frozen", "output", "Boolean")),
            component(
                "spring",
                SPRING,
                connector("stage", "input", "Integer") + connector("locked", "input", "Boolean"),
                values(value("x", "Real", "1")),
            ),
        )
        + connections(
            connection(
                "stair.counter",
                "spring.stage",
                '<ssc:IntegerMappingTransformation><ssc:MapEntry source="1" target="2"/>'
                '<ssc:MapEntry source="2" target="1"/></ssc:IntegerMappingTransformation>',
            ),
            connection(
                "ball.seen_frozen",
                "spring.locked",
                '<ssc:BooleanMappingTransformation><ssc:MapEntry source="false" target="true"/>'
                "</ssc:BooleanMappingTransformation>",
            ),
        ),
        """\
participants:
  stair: {kind: fmu, path: resources/stair.fmu}
  ball: {kind: fmu, path: resources/bouncing_ball.fmu}
  spring:
    kind: fmu
    path: resources/mass_spring_damper.fmu
    start: {x: 1}
    inputs: {stage: {table: {1: 2, 2: 1}}, locked: {table: {0: 1}}}
connections: [stair.counter -> spring.stage, ball.seen_frozen -> spring.locked]
""",
        version="2.0",
        fmus=(STAIR, BALL, SPRING),
    ),
    "loop": System(
        elements(
            component("one", SPRING, F + X, values(value("x", "Real", "0.2"))),
            component("two", SPRING, F + X),
        )
        + connections(
            connection("one.x", "two.F", attributes=UNLIKE), connection("two.x", "one.F", attributes=UNLIKE)
        ),
        f"""\
participants:
  one: {{{SPRING_OF}, start: {{x: 0.2}}, inputs: {{F: {{unit: m}}}}}}
  two: {{{SPRING_OF}, inputs: {{F: {{unit: m}}}}}}
connections: [one.x -> two.F, two.x -> one.F]
""",
    ),
    "arrays": System(
        elements(
            component(
                "one",
                BALL,
                connector("y", "output", "Float64"),
                values(
                    value("size", "UInt64", "2")
                    + '<ssv:Parameter name="u"><ssv:Float64 value="1.5 -2"/></ssv:Parameter>'
                ),
            ),
            component(
                "two",
                BALL,
                connector("u", "input", "Float64") + connector("y", "output", "Float64"),
                values(value("size", "UInt64", "2")),
            ),
        )
        + connections(
            connection("one.y", "two.u", '<ssc:LinearTransformation factor="0.5" offset="-1"/>'),
        ),
        """\
participants:
  one: {kind: fmu, path: resources/bouncing_ball.fmu, start: {size: 2, u: [1.5, -2]}}
  two:
    kind: fmu
    path: resources/bouncing_ball.fmu
    start: {size: 2}
    inputs: {u: {factor: 0.5, offset: -1}}
connections: [one.y -> two.u]
""",
        version="2.0",
        fmus=(BALL,),
    ),
    "apart": System(
        elements(
            component("ball", BALL, bindings=values(value("e", "Float64", "0.9"))), component("stair", STAIR)
        ),
        """\
participants:
  ball: {kind: fmu, path: resources/bouncing_ball.fmu, start: {e: 0.9}}
  stair: {kind: fmu, path: resources/stair.fmu}
""",
        version="2.0",
        fmus=(BALL, STAIR),
    ),
}


def write_fmus(libraries: Mapping[str, Path], directory: Path) -> None:
    """Write the test FMUs, and a spring whose force is a length in mm, to `directory/resources`."""
    folder = directory / "resources"
    folder.mkdir(exist_ok=True, parents=True)
    for model in (SPRING, BALL, STAIR):
        build.pack(model, libraries[model], folder / f"{model}.fmu")
    edits = {
        'description="force on the mass"><Real unit="N"': 'description="force on the mass"><Real unit="mm"'
    }
    build.pack(SPRING, libraries[SPRING], folder / "in_millimetres.fmu", edits)


def description(system: System, name: str) -> str:
    """Return the SSD file."""
    head = HEAD.format(version=system.version, name=name)
    return f'{head}  <ssd:System name="root">{system.text}</ssd:System>\n{TAIL}'


def write_system(system: System, name: str, directory: Path, text: str | None = None) -> Path:
    """Write a system, whose FMUs are in `directory/resources`."""
    path = directory / f"{name}.ssp"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", description(system, name) if text is None else text)
        for file, content in system.files.items():
            archive.writestr(file, content)
        for fmu in system.fmus:
            archive.write(directory / "resources" / f"{fmu}.fmu", f"resources/{fmu}.fmu")
    return path
